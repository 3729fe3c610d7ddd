#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "policy/network_agent.h"
#include "policy/policy_agent.h"
#include "replay/table.h"
#include "tests/learner/every_algorithm.h"

namespace slalom::learner {
namespace {

/// A point on a line that is to stand at 0: it moves by 0.3 times the linear action, and each step
/// takes its distance from the reward. The best policy needs position only, which the goal's x
/// carries. A step that hurries, by more than half of the action, has a cost.
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
            .cost = std::abs(action.linear) > 0.5f ? 1.0f : 0.0f,
            .outcome = ended ? env::Outcome::kTimeout : env::Outcome::kRunning};
  }
  void Observe(std::span<float> state) const {
    state[0] = static_cast<float>(5.0 * (position + 1.0));
    state[1] = 5.0f;
    state[2] = state[3] = 0.0f;
  }

  double position = 0.0;
  int step = 0;
};

struct Score {
  double distance = 0.0;  ///< Mean of all steps.
  double cost = 0.0;      ///< Of an episode.
};

/// Over 50 episodes.
Score Evaluate(env::Agent& agent) {
  constexpr int kEpisodes = 50;
  base::Random random(1000);
  env::ObservationBatch observations;
  observations.Resize(1, PointMass::kBeams);
  std::vector<env::Action> actions(1);
  Score score;
  for (int episode = 0; episode < kEpisodes; ++episode) {
    PointMass point;
    point.Reset(random);
    for (int i = 0; i < PointMass::kSteps; ++i) {
      point.Observe(observations.mutable_state(0));
      agent.Act(observations, env::NumbersOf(actions));
      const env::StepResult result = point.Step(actions[0]);
      score.distance -= static_cast<double>(result.reward) / (kEpisodes * PointMass::kSteps);
      score.cost += static_cast<double>(result.cost) / kEpisodes;
    }
  }
  return score;
}

struct Scores {
  Score untrained;
  Score trained;
  policy::PolicySnapshot policy;  ///< As trained.
};

MethodConfig Method(const std::string& algorithm) {
  MethodConfig method;
  LearnerConfig& config = method.learner;
  config.algorithm = algorithm;
  config.device = DeviceChoice::kCpu;
  config.batch_size = 64;
  config.actor_learning_rate = 1e-3;
  config.critic_learning_rate = 1e-3;
  config.gamma = 0.9;
  config.n_step = 2;
  config.average_rate = 0.01;
  config.temperature = 0.05;
  config.target_entropy = -4.0;
  // TQC's loss compares every quantile with every target. These few suffice here, and take seconds
  // where its defaults take minutes.
  config.quantile_critics = 2;
  config.quantiles = 5;
  config.dropped_quantiles = 1;
  return method;
}

/// Trains by a method for some episodes. Each but the first ten is followed by updates.
void Train(const MethodConfig& method, int num_episodes, int updates_per_episode, Scores* scores) {
  policy::PolicySpec spec;
  spec.observation.num_beams = PointMass::kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {32, 32};
  spec.distribution = DistributionOf(method.learner);
  spec.planning = PlanningOf(method);
  Learner learner(method, spec, 1);
  policy::NetworkAgent agent(learner.Snapshot());
  scores->untrained = Evaluate(agent);

  replay::Table table({.capacity = 5000}, PointMass::kBeams);
  replay::Chunk chunk(PointMass::kBeams);
  std::vector<replay::SampledRows> rows(learner.sample_specs().size());
  base::Random random(2);
  env::ObservationBatch observations;
  observations.Resize(1, PointMass::kBeams);
  std::vector<env::Action> actions(1);
  double cost_lately = 0.0;
  for (int episode = 0; episode < num_episodes; ++episode) {
    PointMass point;
    point.Reset(random);
    chunk.Clear();
    double cost = 0.0;
    for (int i = 0; i < PointMass::kSteps; ++i) {
      point.Observe(observations.mutable_state(0));
      agent.Act(observations, env::NumbersOf(actions));
      const env::Action normal = {static_cast<float>(random.Normal()),
                                  static_cast<float>(random.Normal())};
      if (!agent.Explore(env::NumbersOf(std::span(&normal, 1)), env::NumbersOf(actions))) {
        const float noise = episode < 30 ? 1.0f : 0.2f;
        actions[0].linear = std::clamp(actions[0].linear + noise * normal.linear, -1.0f, 1.0f);
      }
      const env::FrameView frame = observations.frame(0);
      const int row = chunk.BeginStep(0, i == 0, frame, env::NumbersOf(actions));
      const env::StepResult result = point.Step(actions[0]);
      cost += result.cost;
      chunk.SetResult(row, result);
    }
    point.Observe(observations.mutable_state(0));
    chunk.AddFinal(0, observations.frame(0));
    table.Insert(chunk);
    cost_lately += 0.1 * (cost - cost_lately);
    learner.ObserveEpisodes(cost_lately, 1);
    if (episode < 10) continue;
    for (int i = 0; i < updates_per_episode; ++i) {
      for (std::size_t j = 0; j < rows.size(); ++j) {
        ASSERT_TRUE(table.SampleRows(learner.sample_specs()[j], random, &rows[j]));
      }
      learner.Update(rows, 0.0);
    }
    agent.SetSnapshot(learner.Snapshot());
  }
  scores->policy = learner.BestSnapshot();
  agent.SetSnapshot(scores->policy);
  scores->trained = Evaluate(agent);
  EXPECT_TRUE(learner.healthy());
}

/// The best policy: starts are 0.5 away on average and come 0.3 nearer a step, which over ten steps
/// leaves 0.04 on average; standing still leaves 0.5.
constexpr double kNearHome = 0.12;

class ToyTest : public testing::TestWithParam<const char*> {};

TEST_P(ToyTest, LearnsToDriveAPointHome) {
  Scores scores;
  Train(Method(GetParam()), 150, 10, &scores);
  EXPECT_LT(scores.trained.distance, kNearHome);
  EXPECT_GT(scores.untrained.distance, 0.3) << "nothing to learn";
}

TEST_P(ToyTest, AConstraintKeepsItFromHurrying) {
  Scores free, constrained;
  MethodConfig method = Method(GetParam());
  Train(method, 300, 10, &free);
  // What is limited is training, with its noise. Much of TD3's and DDPG's cost is that of the noise
  // alone, so that their policies have less without it. A stochastic policy trains near the limit
  // and has as much without its noise, a little more or less: it gets half the limit.
  const double limit = DistributionOf(method.learner).is_deterministic() ? 0.5 : 0.25;
  method.constraint = {.kind = ConstraintKind::kLagrangian, .limit = limit, .learning_rate = 0.02};
  Train(method, 300, 10, &constrained);
  EXPECT_GT(free.trained.cost, 1.0) << "nothing to constrain";
  EXPECT_LT(constrained.trained.cost, 0.5);
  EXPECT_LT(constrained.trained.distance, 0.25);
}

INSTANTIATE_TEST_SUITE_P(Algorithms, ToyTest, testing::ValuesIn(EveryAlgorithm()),
                         [](const auto& algorithm) { return std::string(algorithm.param); });

/// An algorithm with a small transition model.
MethodConfig ModelMethod(const std::string& algorithm, nn::ModelKind kind, int ensemble) {
  MethodConfig method = Method(algorithm);
  method.model.kind = kind;
  method.model.ensemble = ensemble;
  method.model.encoder_layers = {};
  method.model.head_layers = {32, 32};
  method.model_training.learning_rate = 3e-3;
  method.model_training.batch_size = 64;
  method.model_training.updates_per_update = 10;
  method.model_training.state_loss = StateLoss::kMean;
  return method;
}

struct ModelUse {
  const char* name;
  const char* algorithm;
  ImaginationKind imagination;
  nn::ModelKind model;
  int ensemble;
};

void PrintTo(const ModelUse& use, std::ostream* out) { *out << use.name; }

class ImaginationToyTest : public testing::TestWithParam<ModelUse> {};

// From a tenth of the replayed batches that suffice above, which are too few for it. MBPO's
// policy learns from nothing else than what is imagined, once the model knows enough. DDPG, whose
// one critic nothing keeps from overestimating, needs the model without noise: with it, it stays at
// 0.34.
TEST_P(ImaginationToyTest, LearnsToDriveHomeFromFewReplayedBatches) {
  constexpr int kUpdatesPerEpisode = 1;
  Scores alone, imagining;
  Train(Method(GetParam().algorithm), 150, kUpdatesPerEpisode, &alone);
  MethodConfig method = ModelMethod(GetParam().algorithm, GetParam().model, GetParam().ensemble);
  method.imagination = {.kind = GetParam().imagination,
                        .imagined_batches = 20,
                        .rollout_steps = 2,
                        .noise = 0.2,
                        .learning_starts = 200,
                        .rollouts = 64,
                        .buffer_capacity = 1000,
                        .real_ratio = 0.0};
  Train(method, 150, kUpdatesPerEpisode, &imagining);
  EXPECT_LT(imagining.trained.distance, kNearHome);
  EXPECT_GT(alone.trained.distance, 2.0 * kNearHome) << "no need to imagine";
}

INSTANTIATE_TEST_SUITE_P(
    Uses, ImaginationToyTest,
    testing::Values(
        ModelUse{"DynaDeterministic", "td3", ImaginationKind::kDyna, nn::ModelKind::kDeterministic,
                 1},
        ModelUse{"DynaProbabilistic", "td3", ImaginationKind::kDyna, nn::ModelKind::kProbabilistic,
                 1},
        ModelUse{"Mbpo", "td3", ImaginationKind::kMbpo, nn::ModelKind::kProbabilistic, 3},
        ModelUse{"DdpgDyna", "ddpg", ImaginationKind::kDyna, nn::ModelKind::kDeterministic, 1},
        ModelUse{"SacDyna", "sac", ImaginationKind::kDyna, nn::ModelKind::kProbabilistic, 1},
        ModelUse{"SacMbpo", "sac", ImaginationKind::kMbpo, nn::ModelKind::kProbabilistic, 3}),
    [](const auto& use) { return std::string(use.param.name); });

// Critics and model learn, the policy does not: what drives the point towards home is the plan.
TEST(PlanningToyTest, DrivesTowardsHomeWithAPolicyThatDoesNot) {
  for (const auto& [algorithm, kind] : {std::pair("td3", nn::ModelKind::kDeterministic),
                                        {"td3", nn::ModelKind::kProbabilistic},
                                        {"ddpg", nn::ModelKind::kProbabilistic},
                                        {"sac", nn::ModelKind::kProbabilistic}}) {
    MethodConfig method = ModelMethod(algorithm, kind, 1);
    method.learner.actor_learning_rate = 0.0;
    Scores scores;
    Train(method, 60, 10, &scores);
    EXPECT_GT(scores.trained.distance, 0.3) << "nothing to plan";
    for (const policy::PlanUpdate update : {policy::PlanUpdate::kMppi, policy::PlanUpdate::kCem}) {
      const auto planning = policy::MakePolicyAgent(scores.policy,
                                                    {.enabled = true,
                                                     .horizon = 4,
                                                     .samples = 64,
                                                     .iterations = 3,
                                                     .noise = 0.7,
                                                     .update = update,
                                                     .temperature = 0.05,
                                                     .learning_starts = 0},
                                                    1);
      EXPECT_LT(Evaluate(*planning).distance, scores.trained.distance / 2.0)
          << algorithm << " " << base::EnumName(kind) << " " << base::EnumName(update);
    }
  }
}

}  // namespace
}  // namespace slalom::learner
