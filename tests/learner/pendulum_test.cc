#include "tests/support/pendulum.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "actor/actor.h"
#include "learner/algorithm.h"
#include "learner/learner.h"
#include "policy/network_agent.h"
#include "replay/table.h"
#include "tests/learner/every_algorithm.h"

namespace slalom::learner {
namespace {

using testing::Pendulum;

/// Mean return of 20 episodes.
double Evaluate(env::Agent& agent) {
  constexpr int kEpisodes = 20;
  Pendulum pendulum(kEpisodes);
  for (int i = 0; i < kEpisodes; ++i) pendulum.Reset(i, {0, 1000u + static_cast<unsigned>(i)});
  std::vector<float> actions(kEpisodes);
  std::vector<env::StepResult> results(kEpisodes);
  double sum = 0.0;
  for (int step = 0; step < Pendulum::kSteps; ++step) {
    agent.Act(pendulum.observations(), actions);
    pendulum.Step(actions, results);
    for (const env::StepResult& result : results) sum += static_cast<double>(result.reward);
  }
  return sum / kEpisodes;
}

class PendulumTest : public ::testing::TestWithParam<const char*> {};

// An environment without a scan, with states and actions of other sizes than a course has. It is
// solved at a mean return of about -150; standing policies have -1,200.
TEST_P(PendulumTest, SwingsUp) {
  constexpr int kEnvironments = 4;
  constexpr int kSteps = 3000;
  MethodConfig method;
  LearnerConfig& config = method.learner;
  config.algorithm = GetParam();
  config.device = DeviceChoice::kCpu;
  config.batch_size = 128;
  config.actor_learning_rate = 1e-3;
  config.critic_learning_rate = 1e-3;
  config.reward_scale = 0.1;
  config.gamma = 0.98;
  config.temperature = 0.05;
  config.target_entropy = -1.0;
  config.quantile_critics = 2;
  config.quantiles = 5;
  config.dropped_quantiles = 1;

  Pendulum pendulum(kEnvironments);
  policy::PolicySpec spec;
  spec.observation.num_beams = pendulum.shape().num_beams;
  spec.observation.state_size = pendulum.shape().state_size;
  spec.action_size = pendulum.shape().action_size;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {64, 64};
  spec.distribution = DistributionOf(config);
  spec.planning = PlanningOf(method);
  Learner learner(method, spec, 1);
  policy::NetworkAgent agent(learner.Snapshot());
  const double untrained = Evaluate(agent);

  policy::NetworkAgent driver(learner.Snapshot());
  actor::Actor actor({.noise_min = 0.1, .noise_max = 0.4, .warmup_steps = 1000}, pendulum, driver,
                     2);
  replay::Table table({.capacity = 50000}, pendulum.shape());
  replay::Chunk chunk(pendulum.shape());
  base::Random random(3);
  std::vector<replay::SampledRows> rows(1);
  for (int step = 0; step < kSteps; ++step) {
    chunk.Clear();
    actor.Step(&chunk);
    table.Insert(chunk);
    if (step < 250) continue;
    for (int i = 0; i < 2; ++i) {
      ASSERT_TRUE(table.SampleRows(learner.sample_specs()[0], random, rows.data()));
      learner.Update(rows, 0.0);
    }
    driver.SetSnapshot(learner.Snapshot());
  }
  policy::NetworkAgent trained(learner.BestSnapshot());
  EXPECT_LT(untrained, -700.0) << "nothing to learn";
  EXPECT_GT(Evaluate(trained), -250.0);
}

INSTANTIATE_TEST_SUITE_P(Algorithms, PendulumTest, ::testing::ValuesIn(EveryAlgorithm()),
                         [](const auto& algorithm) { return std::string(algorithm.param); });

}  // namespace
}  // namespace slalom::learner
