#include <gmock/gmock.h>

#include <cerrno>
#include <filesystem>
#include <string>
#include <vector>

#include "run/checkpoint_store.h"
#include "tests/cli/program.h"
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
