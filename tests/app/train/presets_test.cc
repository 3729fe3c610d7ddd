#include "tests/app/train/presets.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "app/train/profile.h"
#include "app/train/resolved_run.h"
#include "base/config.h"
#include "base/error.h"
#include "learner/learner.h"
#include "policy/policy_agent.h"
#include "tests/learner/random_rows.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

const fs::path& Root() {
  static const fs::path root = fs::path(SLALOM_SOURCE_DIR) / "configs";
  return root;
}

/// Every preset that trains, below configs/, without ".toml".
std::vector<std::string> Presets() {
  std::vector<std::string> names;
  for (fs::path preset : test::TrainingPresets()) {
    names.push_back(fs::relative(preset.replace_extension(), Root()).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// The learned rows of the paper's tables: networks and frames (I), safe RL (II), model-based
/// methods (III); beside them DDPG and SAC, which it calls similar.
std::vector<std::string> RowsOfThePaper() {
  std::vector<std::string> rows = {"td3-mlp"};
  for (const char* encoder : {"mlp", "cnn", "gru", "transformer"}) {
    for (const int history : {4, 8}) rows.push_back(fmt::format("td3-{}-h{}", encoder, history));
  }
  for (const char* method :
       {"ddpg", "sac", "lagrangian", "dyna-deterministic", "dyna-probabilistic",
        "mpc-deterministic", "mpc-probabilistic", "mbpo"}) {
    rows.push_back(fmt::format("{}-mlp", method));
  }
  return rows;
}

TEST(Presets, ThereIsOneForEachRowOfThePaper) {
  const std::vector<std::string> presets = Presets();
  for (const char* folder : {"fast", "paper", "paper/as-published"}) {
    for (const std::string& row : RowsOfThePaper()) {
      // The original's cannot run (docs/original-system.md, section 5.3, M4).
      if (folder == std::string("paper/as-published") && row == "mbpo-mlp") continue;
      const std::string preset = fmt::format("{}/{}", folder, row);
      EXPECT_TRUE(std::binary_search(presets.begin(), presets.end(), preset)) << preset;
    }
  }
}

class PresetTest : public testing::TestWithParam<std::string> {
 protected:
  RunConfig Load() const {
    return config::Load<RunConfig>(Root() / (GetParam() + ".toml"),
                                   std::vector<std::string>{"learner.device=cpu"});
  }
};

TEST_P(PresetTest, DrivesTheDefaultRobotUnderTheProfileOfHome) {
  sim::EnvironmentConfig laid = Load().environment;
  planners::GuardConfig guard;
  LayProfile(Root() / "home.toml", laid, guard);
  RunConfig with_its_robot;
  with_its_robot.environment.randomize = laid.randomize;
  with_its_robot.environment.robot = laid.robot;
  with_its_robot.environment.lidar = laid.lidar;
  with_its_robot.environment.localisation = laid.localisation;
  EXPECT_EQ(config::ToToml(with_its_robot), config::ToToml(RunConfig{}));
}

TEST_P(PresetTest, PrintsToItself) {
  const RunConfig config = Load();
  const std::string printed = config::ToToml(config);
  EXPECT_EQ(config::ToToml(config::FromToml<RunConfig>(printed, GetParam() + " (printed)")),
            printed);
}

TEST_P(PresetTest, LearnsFromABatchAndActs) {
  RunConfig config = Load();
  (void)Resolve(config, {.drives = "slalom train", .begins = true});
  // The sizes of networks are the preset's. A few rows tell as much as many.
  config.method.learner.batch_size = config.method.model_training.batch_size = 16;
  learner::Learner learner(config.method, MakePolicySpec(config), 1);
  const env::StepShape shape = StepShapeOf(config);
  const learner::RandomBatches drawn(learner.sample_specs(), shape, 7);
  learner.Update(drawn.batches, 0.0);
  EXPECT_TRUE(learner.healthy());

  policy::MpcConfig mpc = config.mpc;
  mpc.learning_starts = 0;
  const auto agent = policy::MakePolicyAgent(learner.Snapshot(), mpc, 1);
  env::ObservationBatch observations;
  observations.Resize(1, shape.num_beams, shape.state_size);
  std::vector<env::Action> actions(1);
  agent->Act(observations, env::NumbersOf(actions));
  EXPECT_TRUE(std::isfinite(actions[0].linear) && std::isfinite(actions[0].angular));
}

INSTANTIATE_TEST_SUITE_P(All, PresetTest, testing::ValuesIn(Presets()), [](const auto& test) {
  std::string name = test.param;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(c); }, '_');
  return name;
});

}  // namespace
}  // namespace slalom::train
