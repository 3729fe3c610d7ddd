#include "app/train/begin_run.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <ostream>
#include <string>

#include "base/config.h"
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
  EXPECT_EQ(base::ReadFile(directory.config()), config::ToToml(config));
  config.method.learner.gamma = 0.9;
  try {
    ResumeRun(directory, config);
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("learner.gamma was 0.99 when the run began and is 0.9 now"));
  }
}

struct Change {
  const char* key;
  void (*make)(RunConfig& config);
};

void PrintTo(const Change& change, std::ostream* out) { *out << change.key; }

class ResumeTest : public testing::TestWithParam<Change> {};

// The config tells what a checkpoint cannot: a GRU's tensors have the same shapes for every
// history, and so have all networks that see ranges by sectors for every lidar.
TEST_P(ResumeTest, RefusesTheCheckpointsOfAnotherLearner) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "run"};
  RunConfig config;
  config.network = {.encoder = nn::EncoderFamily::kGru, .history = 4, .sectors = 72};
  BeginRun(directory, config);
  EXPECT_NO_THROW(ResumeRun(directory, config));
  GetParam().make(config);
  try {
    ResumeRun(directory, config);
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(std::string(GetParam().key) + " was "));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Changes, ResumeTest,
    testing::Values(
        Change{"network.history", [](RunConfig& c) { c.network.history = 8; }},
        Change{"network.encoder",
               [](RunConfig& c) { c.network.encoder = nn::EncoderFamily::kTransformer; }},
        Change{"network.encoder_layers", [](RunConfig& c) { c.network.encoder_layers = {64}; }},
        Change{"network.sectors", [](RunConfig& c) { c.network.sectors = 36; }},
        Change{"environment.lidar.num_beams",
               [](RunConfig& c) { c.environment.lidar.num_beams = 360; }},
        Change{"learner.algorithm", [](RunConfig& c) { c.method.learner.algorithm = "ddpg"; }},
        Change{"model.kind",
               [](RunConfig& c) { c.method.model.kind = nn::ModelKind::kDeterministic; }}),
    [](const auto& change) {
      std::string name = change.param.key;
      std::ranges::replace(name, '.', '_');
      return name;
    });

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
