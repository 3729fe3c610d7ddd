#include "app/sweep/cell_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "app/sweep/store.h"
#include "base/file.h"
#include "learner/run/run_directory.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

/// A cell whose training was stopped, and a stand-in for `slalom` that writes down what it was
/// asked and fails.
struct StoppedCell {
  explicit StoppedCell(const fs::path& directory)
      : cell(test::Expand(directory, std::string(test::kSweep) + test::kTinyScore).cells.at(0)),
        options{.store = directory / "store", .program = directory / "program"},
        files(options.store, cell.id),
        run{files.run()},
        checkpoint(run.checkpoints() / "step-60000") {
    base::WriteFileAtomically(options.program,
                              "#!/bin/sh\necho \"$@\" >> \"$(dirname \"$0\")/calls\"\nexit 1\n");
    fs::permissions(options.program, fs::perms::owner_all);
    base::MakeDirectories(checkpoint);
    base::WriteFileAtomically(run.config(), "");
  }

  WorkEnd Work() const { return WorkOnCell(cell, options, *ClaimTaker().Try(files.root()), {}); }

  std::string Calls() const {
    const fs::path calls = options.program.parent_path() / "calls";
    return fs::exists(calls) ? base::ReadFile(calls) : "";
  }

  Cell cell;
  const WorkOptions options;
  const CellDirectory files;
  const run::RunDirectory run;
  const fs::path checkpoint;
};

std::string Repeat(const std::string& text, int times) {
  std::string repeated;
  for (int i = 0; i < times; ++i) repeated += text;
  return repeated;
}

TEST(CellWorkTest, ARunThatCannotBeLookedAtIsKeptAndGoesOnAtTheNextTry) {
  for (const test::FailingCall& call :
       {test::FailingCall{.function = "stat", .path = "*/run/config.toml", .error = EIO},
        test::FailingCall{.function = "stat", .path = "*/run/checkpoints", .error = ESTALE},
        test::FailingCall{.function = "stat", .path = "*/trained.json", .error = EACCES},
        test::FailingCall{.function = "openat", .path = "*/run/checkpoints", .error = EMFILE}}) {
    SCOPED_TRACE(call.path);
    const test::ScratchDirectory scratch;
    const StoppedCell stopped(scratch.path());
    const test::FailingCalls failing(call, scratch.path() / "count");
    EXPECT_EQ(stopped.Work(), WorkEnd::kFailed);
    EXPECT_GE(failing.num_calls(), 1);
    EXPECT_TRUE(fs::exists(stopped.checkpoint));
    // Of three tries the first one ended at the failing call.
    EXPECT_EQ(stopped.Calls(),
              Repeat("train " + stopped.run.root.string() + " --resume --no-evaluation\n", 2));
  }
}

TEST(CellWorkTest, ARunThatAnotherProcessHoldsIsLeftToIt) {
  const test::ScratchDirectory scratch;
  const StoppedCell stopped(scratch.path());
  const run::RunLock lock(stopped.run.root);
  EXPECT_EQ(stopped.Work(), WorkEnd::kLost);
  EXPECT_EQ(stopped.Calls(), "");
  EXPECT_TRUE(fs::exists(stopped.checkpoint));
}

TEST(CellWorkTest, AnErrorThatStaysIsWhyTheCellFailed) {
  const test::ScratchDirectory scratch;
  const StoppedCell stopped(scratch.path());
  const test::FailingCalls failing(
      {.function = "stat", .path = "*/run/config.toml", .error = EIO, .last = 1000},
      scratch.path() / "count");
  EXPECT_EQ(stopped.Work(), WorkEnd::kFailed);
  EXPECT_TRUE(fs::exists(stopped.checkpoint));
  EXPECT_EQ(stopped.Calls(), "");
  EXPECT_THAT(ReadCellStatus(stopped.options.store, stopped.cell).failure.value().what,
              testing::HasSubstr("config.toml: cannot be looked at (Input/output error)"));
}

TEST(CellWorkTest, ARunWithoutACheckpointIsSetAsideForOneThatBegins) {
  const test::ScratchDirectory scratch;
  const StoppedCell stopped(scratch.path());
  fs::remove(stopped.checkpoint);
  base::WriteFileAtomically(stopped.run.metrics(), "rows");
  EXPECT_EQ(stopped.Work(), WorkEnd::kFailed);
  EXPECT_EQ(stopped.Calls(), Repeat("train " + stopped.files.config().string() + " --output " +
                                        stopped.files.root().string() + " --no-evaluation\n",
                                    3));
  EXPECT_FALSE(fs::exists(stopped.run.root));
  EXPECT_EQ(base::ReadFile(stopped.files.root() / "run.aside" / "metrics.csv"), "rows");
}

TEST(CellWorkTest, ARunWhoseStageHasBegunGoesOn) {
  const test::ScratchDirectory scratch;
  StoppedCell stopped(scratch.path());
  fs::remove(stopped.checkpoint);
  test::AddStages(stopped.cell);
  base::MakeDirectories(stopped.run.root / "stages" / "first");
  EXPECT_EQ(stopped.Work(), WorkEnd::kFailed);
  EXPECT_EQ(stopped.Calls(),
            Repeat("train " + stopped.run.root.string() + " --resume --no-evaluation\n", 3));
  EXPECT_TRUE(fs::exists(stopped.run.root / "stages" / "first"));
}

TEST(CellWorkTest, ATrainingWithoutItsPolicyIsTrainedAgainForAScoreThatIsNotThere) {
  const test::ScratchDirectory scratch;
  const StoppedCell imported(scratch.path());
  fs::remove_all(imported.run.root);
  WriteTrained(imported.files, {.steps = 4000, .updates = 9});
  const fs::path score = imported.files.root() / "scores" / "of-another-plan";
  base::MakeDirectories(score);
  base::WriteFileAtomically(score / "evaluation.json", "{}");
  EXPECT_EQ(imported.Work(), WorkEnd::kFailed);
  EXPECT_FALSE(fs::exists(imported.files.trained()));
  EXPECT_FALSE(fs::exists(score)) << "it is of another training";
  EXPECT_EQ(imported.Calls(), Repeat("train " + imported.files.config().string() + " --output " +
                                         imported.files.root().string() + " --no-evaluation\n",
                                     3));
}

}  // namespace
}  // namespace slalom::sweep
