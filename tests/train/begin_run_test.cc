#include "train/begin_run.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::train {
namespace {

TEST(RunDirectoryTest, AnEarlierRunIsMovedAsideAndKept) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "quickstart"};
  for (int i = 0; i < 3; ++i) {
    BeginRun(directory, RunConfig{});
    EXPECT_FALSE(std::filesystem::exists(directory.policy()));
    base::WriteFileAtomically(directory.policy(), "run " + std::to_string(i));
  }
  EXPECT_EQ(base::ReadFile(scratch.path() / "quickstart.1" / "policy.safetensors"), "run 0");
  EXPECT_EQ(base::ReadFile(scratch.path() / "quickstart.2" / "policy.safetensors"), "run 1");
  EXPECT_EQ(base::ReadFile(directory.policy()), "run 2");
}

TEST(RunDirectoryTest, AResumedRunMayGoOnLongerButNotOtherwise) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config;
  BeginRun(directory, config);
  config.run.max_steps *= 2;
  config.evaluation.episodes_per_course = 3;
  EXPECT_NO_THROW(ResumeRun(directory, config));
  config.method.learner.gamma = 0.9;
  try {
    ResumeRun(directory, config);
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("learner.gamma was 0.99 in the run, is 0.9 now"));
  }
}

TEST(RunDirectoryTest, TwoProcessesDoNotTrainInOneDirectory) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  {
    const run::RunLock lock = BeginRun(directory, RunConfig{});
    EXPECT_THROW(BeginRun(directory, RunConfig{}), base::Error);
    EXPECT_THROW(ResumeRun(directory, RunConfig{}), base::Error);
    EXPECT_TRUE(std::filesystem::exists(directory.config()));
  }
  const run::RunLock lock = ResumeRun(directory, RunConfig{});
  EXPECT_THROW(BeginRun(directory, RunConfig{}), base::Error);
}

TEST(RunDirectoryTest, NothingToResumeIsAnError) {
  const test::ScratchDirectory scratch;
  EXPECT_THROW(ResumeRun({scratch.path() / "none"}, RunConfig{}), base::Error);
}

}  // namespace
}  // namespace slalom::train
