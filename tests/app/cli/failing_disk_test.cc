#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cerrno>
#include <filesystem>
#include <string>
#include <vector>

#include "base/file.h"
#include "learner/run/checkpoint_store.h"
#include "learner/run/run_directory.h"
#include "policy/policy.h"
#include "tests/app/cli/program.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"

/// Trainings whose disk fails for a moment.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::vector<std::string> kTrain = {"train", "tiny.toml", "--no-evaluation"};

/// Copies the run at `run` and goes on from each of its checkpoints.
void ExpectEachCheckpointGoesOn(const fs::path& directory, const fs::path& run) {
  const auto checkpoints = run::CheckpointStore(run / "checkpoints").List();
  ASSERT_EQ(checkpoints.size(), 2u);
  for (const fs::path& checkpoint : checkpoints) {
    const std::string name = checkpoint.filename();
    const fs::path copy = directory / ("from-" + name);
    fs::copy(run, copy, fs::copy_options::recursive);
    for (const fs::path& other : checkpoints) {
      if (other != checkpoint) fs::remove_all(copy / "checkpoints" / other.filename());
    }
    const ProgramResult resumed = RunProgram(
        {"train", copy.string(), "--resume", "--set", "run.max_steps=4600", "--no-evaluation"},
        directory);
    EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_THAT(resumed.err, HasSubstr("resumed from " + (copy / "checkpoints" / name).string()));
  }
}

// It was taken for an empty one, for which no replay data had to be kept.
TEST(FailingDiskTest, AListingThatFailsOnceCostsATrainingNothing) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 4000, "checkpoint_steps = 500\nkeep_checkpoints = \"all\"\n");
  {
    const FailingCalls failing(
        {.function = "openat", .path = "*/checkpoints", .error = EMFILE, .first = 7},
        scratch.path() / "calls", SLALOM_FAILING_LIBC);
    const ProgramResult result = RunProgram(kTrain, scratch.path());
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("checkpoints: cannot be listed (Too many open files)"));
    EXPECT_GE(failing.num_calls(), 7);
  }
  ExpectEachCheckpointGoesOn(scratch.path(), scratch.path() / "runs/tiny");
}

TEST(FailingDiskTest, ACheckpointThatFailsForAnyReasonEndsNoTraining) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 4000, "checkpoint_steps = 500\nkeep_checkpoints = \"all\"\n");
  {
    const FailingCalls failing(
        {.function = "stat", .path = "*/checkpoints/step-*[0-9]", .error = EIO, .first = 3},
        scratch.path() / "calls", SLALOM_FAILING_LIBC);
    const ProgramResult result = RunProgram(kTrain, scratch.path());
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("training goes on, the earlier one is kept"));
    EXPECT_GE(failing.num_calls(), 3);
  }
  ExpectEachCheckpointGoesOn(scratch.path(), scratch.path() / "runs/tiny");
}

// Of the replay data that the checkpoints need, what is written from the second one on.
constexpr FailingCall kFullAfterTheFirst{
    .function = "write", .path = "*/replay-000001.rows.tmp", .error = ENOSPC, .last = 1000000};

TEST(FailingDiskTest, AFullDiskAtTheEndOfATrainingCostsItsLastCheckpointAlone) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 2000, "checkpoint_steps = 1000\n");
  const fs::path run = scratch.path() / "runs/tiny";
  {
    const FailingCalls failing(kFullAfterTheFirst, scratch.path() / "calls", SLALOM_FAILING_LIBC);
    const ProgramResult result = RunProgram({"train", "tiny.toml"}, scratch.path());
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_GE(failing.num_calls(), 1);
    EXPECT_THAT(result.err,
                HasSubstr("replay-000001.rows: cannot write (No space left on device)"));
    EXPECT_THAT(result.err, HasSubstr("the policy is kept in runs/tiny/policy.safetensors"));
    EXPECT_THAT(result.out, HasSubstr("evaluate --policy runs/tiny/policy.safetensors"));
  }
  EXPECT_EQ(policy::LoadPolicy(run / "policy.safetensors").metadata.at("steps"), "2000");
  EXPECT_TRUE(fs::exists(run / "training.html"));
  // With room again, the run goes on from the checkpoint before.
  const ProgramResult resumed = RunProgram({"train", "runs/tiny", "--resume"}, scratch.path());
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_THAT(resumed.err, HasSubstr("resumed from runs/tiny/checkpoints/step-1000"));
  EXPECT_TRUE(fs::exists(run / "evaluation.json"));
}

TEST(FailingDiskTest, APolicyWithoutAnyCheckpointIsKept) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 2000);
  const fs::path policy = scratch.path() / "runs/tiny/policy.safetensors";
  {
    FailingCall full = kFullAfterTheFirst;
    full.path = "*/replay-*.rows.tmp";
    const FailingCalls failing(full, scratch.path() / "calls", SLALOM_FAILING_LIBC);
    EXPECT_EQ(RunProgram(kTrain, scratch.path()).exit_code, 1);
    EXPECT_GE(failing.num_calls(), 1);
  }
  const std::string before = base::ReadFile(policy);
  const ProgramResult resumed = RunProgram({"train", "runs/tiny", "--resume"}, scratch.path());
  EXPECT_EQ(resumed.exit_code, 1);
  EXPECT_THAT(resumed.err, HasSubstr("policy.safetensors would be overwritten"));
  EXPECT_EQ(base::ReadFile(policy), before);
}

TEST(FailingDiskTest, ScoresThatAreNotWrittenAreShownAndCanBeMadeLater) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1000);
  std::string resume;
  {
    const FailingCalls failing(
        {.function = "write", .path = "*/runs/tiny/evaluation*", .error = ENOSPC, .last = 1000000},
        scratch.path() / "calls", SLALOM_FAILING_LIBC);
    const ProgramResult result = RunProgram({"train", "tiny.toml"}, scratch.path());
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("No space left on device"));
    EXPECT_THAT(result.out, HasSubstr("success"));
    const auto at = result.out.find("to score it: ");
    ASSERT_NE(at, std::string::npos) << result.out;
    resume = result.out.substr(at + 13);
  }
  const ProgramResult scored = RunShell(resume, scratch.path());
  EXPECT_EQ(scored.exit_code, 0) << resume << scored.err;
  EXPECT_TRUE(fs::exists(scratch.path() / "runs/tiny/evaluation.json"));
  EXPECT_THAT(RunShell(resume, scratch.path()).out, HasSubstr("nothing was changed"));
}

TEST(FailingDiskTest, APageThatIsNotWrittenKeepsNoPolicyFromBeingScored) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1000);
  const FailingCalls failing(
      {.function = "write", .path = "*/training.html.tmp", .error = ENOSPC, .last = 1000},
      scratch.path() / "calls", SLALOM_FAILING_LIBC);
  const ProgramResult result = RunProgram({"train", "tiny.toml"}, scratch.path());
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("training.html: cannot write"));
  EXPECT_TRUE(fs::exists(scratch.path() / "runs/tiny/curve.csv"));
}

// So many rows that the checkpoints need more than half as much again as the disk has.
TEST(FailingDiskTest, ATrainingWhoseCheckpointsCannotFitIsRefusedBeforeItTouchesAnything) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1000);
  // A training that is not refused ends at this lock, before it takes all of the memory.
  base::MakeDirectories(scratch.path() / "runs/tiny");
  const run::RunLock lock(scratch.path() / "runs/tiny");
  const std::uintmax_t rows = fs::space(scratch.path()).available / 8192 / 2;
  std::vector<std::string> train = kTrain;
  for (const std::string& set :
       {std::string("environment.lidar.num_beams=4096"), std::string("network.sectors=64"),
        fmt::format("replay.capacity={}", rows), fmt::format("run.checkpoint_steps={}", rows),
        fmt::format("run.max_steps={}", 4 * rows)}) {
    train.insert(train.end(), {"--set", set});
  }
  const ProgramResult result = RunProgram(train, scratch.path());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::AllOf(HasSubstr("runs/tiny: "), HasSubstr("are free"),
                                         HasSubstr(fmt::format("replay.capacity = {}", rows)),
                                         HasSubstr("run.checkpoint_steps")));
  EXPECT_THAT(base::ListDirectory(scratch.path() / "runs/tiny"),
              testing::ElementsAre(scratch.path() / "runs/tiny/lock"));
}

TEST(FailingDiskTest, ALowLimitOfDescriptorsIsRaised) {
  const ScratchDirectory scratch;
  WriteTinyConfig(scratch.path(), 1000);
  const ProgramResult result =
      RunShell("exec 3>&- 4>&-; ulimit -S -n 5; exec \"$SLALOM\" train tiny.toml --no-evaluation",
               scratch.path());
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

}  // namespace
}  // namespace slalom::test
