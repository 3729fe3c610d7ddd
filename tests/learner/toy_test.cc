#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "policy/network_agent.h"
#include "replay/table.h"

namespace slalom::learner {
namespace {

/// A point on a line that is to stand at 0: it moves by 0.3 times the linear action, and each step
/// costs its distance. The best policy needs position only, which the goal's x carries.
struct PointMass {
  static constexpr int kBeams = 4;
  static constexpr int kSteps = 10;

  void Reset(base::Random& random) {
    position = random.Uniform(-1.0, 1.0);
    step = 0;
  }
  env::StepResult Step(const env::Action& action) {
    position = std::clamp(position + 0.3 * std::clamp(action.linear, -1.0f, 1.0f), -1.5, 1.5);
    const bool ended = ++step == kSteps;
    return {.reward = static_cast<float>(-std::abs(position)),
            .outcome = ended ? env::Outcome::kTimeout : env::Outcome::kRunning};
  }
  void Observe(std::span<float, env::kStateSize> state) const {
    state[0] = static_cast<float>(5.0 * (position + 1.0));
    state[1] = 5.0f;
    state[2] = state[3] = 0.0f;
  }

  double position = 0.0;
  int step = 0;
};

/// Mean distance over 50 episodes.
double Evaluate(env::Agent& agent) {
  base::Random random(1000);
  env::ObservationBatch observations;
  observations.Resize(1, PointMass::kBeams);
  std::vector<env::Action> actions(1);
  double total = 0.0;
  for (int episode = 0; episode < 50; ++episode) {
    PointMass point;
    point.Reset(random);
    for (int i = 0; i < PointMass::kSteps; ++i) {
      point.Observe(observations.mutable_state(0));
      agent.Act(observations, actions);
      total -= point.Step(actions[0]).reward;
    }
  }
  return total / (50.0 * PointMass::kSteps);
}

class ToyTest : public testing::TestWithParam<const char*> {};

TEST_P(ToyTest, LearnsToDriveAPointHome) {
  policy::PolicySpec spec;
  spec.observation.num_beams = PointMass::kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {32, 32};
  MethodConfig method;
  LearnerConfig& config = method.learner;
  config.algorithm = GetParam();
  config.device = "cpu";
  config.batch_size = 64;
  config.actor_learning_rate = 1e-3;
  config.critic_learning_rate = 1e-3;
  config.gamma = 0.9;
  config.n_step = 2;
  config.average_rate = 0.01;
  config.temperature = 0.05;
  config.target_entropy = -4.0;
  spec.distribution = DistributionOf(config);
  Learner learner(method, spec, 1);
  policy::NetworkAgent agent(learner.Snapshot());
  const double untrained = Evaluate(agent);

  replay::Table table({.capacity = 5000}, PointMass::kBeams);
  replay::Chunk chunk(PointMass::kBeams);
  replay::SampledRows rows;
  base::Random random(2);
  env::ObservationBatch observations;
  observations.Resize(1, PointMass::kBeams);
  std::vector<env::Action> actions(1);
  for (int episode = 0; episode < 150; ++episode) {
    PointMass point;
    point.Reset(random);
    chunk.Clear();
    for (int i = 0; i < PointMass::kSteps; ++i) {
      point.Observe(observations.mutable_state(0));
      agent.Act(observations, actions);
      const env::Action normal = {static_cast<float>(random.Normal()),
                                  static_cast<float>(random.Normal())};
      if (!agent.Explore({&normal, 1}, actions)) {
        const float noise = episode < 30 ? 1.0f : 0.2f;
        actions[0].linear = std::clamp(actions[0].linear + noise * normal.linear, -1.0f, 1.0f);
      }
      const env::FrameView frame = observations.frame(0);
      const int row = chunk.BeginStep(0, i == 0, frame, actions[0]);
      chunk.SetResult(row, point.Step(actions[0]));
    }
    point.Observe(observations.mutable_state(0));
    chunk.AddFinal(0, observations.frame(0));
    table.Insert(chunk);
    if (episode < 10) continue;
    for (int i = 0; i < PointMass::kSteps; ++i) {
      ASSERT_TRUE(table.SampleRows(learner.sample_specs()[0], random, &rows));
      learner.Update({&rows, 1}, 0.0);
    }
    agent.SetSnapshot(learner.Snapshot());
  }
  agent.SetSnapshot(learner.BestSnapshot());
  // The best policy: starts are 0.5 away on average and come 0.3 nearer a step, which over ten
  // steps leaves 0.04 on average; standing still leaves 0.5.
  EXPECT_LT(Evaluate(agent), 0.12);
  EXPECT_GT(untrained, 0.3) << "nothing to learn";
  EXPECT_TRUE(learner.healthy());
}

INSTANTIATE_TEST_SUITE_P(Algorithms, ToyTest, testing::Values("td3", "ddpg", "sac"),
                         [](const auto& algorithm) { return std::string(algorithm.param); });

}  // namespace
}  // namespace slalom::learner
