#include "app/sweep/runner.h"

#include <gmock/gmock.h>

#include <cerrno>
#include <filesystem>

#include "app/sweep/store.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

/// A stand-in for `slalom` that only writes the files which a sweep looks for.
fs::path WriteProgram(const fs::path& directory, const std::string& body) {
  const fs::path path = directory / "program";
  base::WriteFileAtomically(path, "#!/bin/sh\n" + body);
  fs::permissions(path, fs::perms::owner_all);
  return path;
}

/// `evaluate ... --output DIR ...` writes DIR/evaluation.json.
constexpr char kEvaluate[] =
    "echo \"$@\" >> \"$(dirname \"$0\")/calls\"\n"
    "while [ \"$1\" != --output ]; do shift; done\n"
    "mkdir -p \"$2\" && echo '{\"success_rate\": 0.5}' > \"$2/evaluation.json\"\n";

/// Cells of planners: nothing is trained.
Cells PlannerCells(const fs::path& directory) {
  return test::Expand(directory, std::string(test::kSweep) + test::kTinyScore +
                                     "[[group]]\nname = \"dwa\"\nplanner = \"dwa\"\n"
                                     "[[group]]\nname = \"mppi\"\nplanner = \"mppi\"\n"
                                     "[[group]]\nname = \"teb\"\nplanner = \"teb\"\n");
}

int CountCalls(const fs::path& directory) {
  if (!fs::exists(directory / "calls")) return 0;
  const std::string calls = base::ReadFile(directory / "calls");
  return static_cast<int>(std::ranges::count(calls, '\n'));
}

SweepEnd Work(const fs::path& directory, const Cells& cells, const fs::path& program, int at_once) {
  return RunCells(cells.cells, {.store = directory / "store", .program = program},
                  {.at_once = at_once}, {}, [] {});
}

TEST(RunnerTest, EachCellIsDoneOnceHoweverManySlots) {
  const test::ScratchDirectory scratch;
  const Cells cells = PlannerCells(scratch.path());
  const fs::path program = WriteProgram(scratch.path(), kEvaluate);
  const SweepEnd end = Work(scratch.path(), cells, program, 4);
  EXPECT_EQ(end.num_done, 3);
  EXPECT_EQ(end.num_failed, 0);
  EXPECT_EQ(CountCalls(scratch.path()), 3);
  EXPECT_EQ(Work(scratch.path(), cells, program, 2).num_done, 3);
  EXPECT_EQ(CountCalls(scratch.path()), 3) << "what is done is not done again";
}

TEST(RunnerTest, SeveralWorkersShareTheWork) {
  const test::ScratchDirectory scratch;
  const Cells cells = PlannerCells(scratch.path());
  const fs::path program = WriteProgram(scratch.path(), kEvaluate);
  {
    std::vector<std::jthread> workers;
    for (int i = 0; i < 3; ++i) {
      workers.emplace_back([&] { EXPECT_EQ(Work(scratch.path(), cells, program, 1).num_done, 3); });
    }
  }
  EXPECT_EQ(CountCalls(scratch.path()), 3);
}

TEST(RunnerTest, AFailureIsTriedThreeTimesThenKeptWithTheEndOfItsLog) {
  const test::ScratchDirectory scratch;
  const Cells cells = PlannerCells(scratch.path());
  const fs::path program = WriteProgram(
      scratch.path(), std::string("case \"$*\" in *'--agent dwa'*) echo attempt >> \"$(dirname "
                                  "\"$0\")/failures\"; echo no luck; exit 1;; esac\n") +
                          kEvaluate);
  const SweepEnd end = Work(scratch.path(), cells, program, 2);
  EXPECT_EQ(end.num_done, 2);
  EXPECT_EQ(end.num_failed, 1);
  EXPECT_EQ(base::ReadFile(scratch.path() / "failures"), "attempt\nattempt\nattempt\n");
  const CellStatus status = ReadCellStatus(scratch.path() / "store", cells.cells[0]);
  EXPECT_EQ(status.state, CellState::kFailed);
  EXPECT_EQ(status.failure->what, "`slalom evaluate` ended with exit code 1 (score 'test')");
  EXPECT_EQ(status.failure->log, "no luck\n") << "of the last attempt alone";
}

TEST(RunnerTest, AThreadThatCannotBeStartedEndsTheWorker) {
  const test::ScratchDirectory scratch;
  const Cells cells = PlannerCells(scratch.path());
  const fs::path program = WriteProgram(scratch.path(), kEvaluate);
  {
    const test::FailingCalls failing(
        {.function = "pthread_create", .path = "thread", .error = EAGAIN, .first = 2}, "none");
    EXPECT_THAT([&] { Work(scratch.path(), cells, program, 3); },
                testing::ThrowsMessage<base::Error>(testing::HasSubstr("a cell of the sweep")));
  }
  EXPECT_EQ(Work(scratch.path(), cells, program, 3).num_done, 3);
}

TEST(RunnerTest, CellsFillTheMachineAndThenKeepToTheirCores) {
  const Slots all = ShareOut({4, 5, 6, 7}, 0, true);
  EXPECT_EQ(all.at_once, 4);
  EXPECT_EQ(all.threads, 1);
  EXPECT_TRUE(all.pinned);
  const Slots threads = ShareOut({0, 1, 2, 3}, 0, false);
  EXPECT_EQ(threads.at_once, 2);
  EXPECT_EQ(threads.threads, 2);
  EXPECT_TRUE(threads.pinned);
  EXPECT_FALSE(ShareOut({0, 1, 2, 3}, 1, true).pinned) << "others may be beside it";
  EXPECT_FALSE(ShareOut({0, 1}, 5, true).pinned);
  EXPECT_EQ(ShareOut({0, 1}, 5, true).at_once, 5);
}

}  // namespace
}  // namespace slalom::sweep
