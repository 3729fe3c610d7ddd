#include "policy/mpc_agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/random.h"
#include "policy/action_samples.h"
#include "policy/network_agent.h"
#include "policy/nn/feature_map.h"
#include "tests/support/every_value.h"

namespace slalom::policy {
namespace {

constexpr int kBeams = 3;
constexpr int kFrame = kBeams + env::kStateSize;
constexpr int kGoal = kBeams;  // Column of the goal's x.

/// Networks without hidden layers, whose weights are set by hand: with x the goal's x as a feature,
///
///     policy: linear action tanh(bias + follow * x), angular 0;   critic: value * x;
///     model: x' = x + 0.5 linear, reward = x;   nothing terminates.
///
/// So the best first action is +1 whatever the state.
struct Hand {
  double bias = -0.5;
  double follow = 0.0;
  double value = 1.0;
  double termination_logit = -30.0;
  double termination_by_x = 0.0;
  double gamma = 1.0;
};

PolicySnapshot MakeSnapshot(const Hand& hand) {
  PolicySnapshot snapshot;
  snapshot.spec.observation.num_beams = kBeams;
  snapshot.spec.network.encoder_layers = {};
  snapshot.spec.network.head_layers = {};
  snapshot.spec.planning.model.kind = nn::ModelKind::kDeterministic;
  snapshot.spec.planning.model.encoder_layers = {};
  snapshot.spec.planning.model.head_layers = {};
  snapshot.spec.planning.gamma = hand.gamma;
  // Weights [outputs, inputs], then biases.
  std::vector<float> actor(2 * kFrame + 2), critic(kFrame + 2 + 1);
  actor[2 * kFrame] = static_cast<float>(hand.bias);
  actor[kGoal] = static_cast<float>(hand.follow);
  critic[kGoal] = static_cast<float>(hand.value);
  const nn::ModelShape shape = snapshot.spec.model_shape();
  const int inputs = kFrame + 2;
  const int outputs = shape.network.num_outputs();
  std::vector<float> model(shape.num_parameters());
  EXPECT_EQ(std::ssize(model), outputs * (inputs + 1));
  model[kGoal * inputs + kFrame] = 0.5f;                 // x' - x by the linear action
  model[shape.reward_column() * inputs + kGoal] = 1.0f;  // the reward by x
  model[outputs * inputs + shape.termination_column()] = static_cast<float>(hand.termination_logit);
  model[shape.termination_column() * inputs + kGoal] = static_cast<float>(hand.termination_by_x);
  const auto share = [](std::vector<float> values) {
    return std::make_shared<const std::vector<float>>(std::move(values));
  };
  snapshot.weights = share(std::move(actor));
  snapshot.model_weights = share(std::move(model));
  snapshot.critic_weights = share(std::move(critic));
  return snapshot;
}

env::ObservationBatch Observations(int batch, std::uint64_t seed) {
  base::Random random(seed);
  env::ObservationBatch observations;
  observations.Resize(batch, kBeams);
  for (auto& range : observations.ranges_cm) {
    range = static_cast<std::uint16_t>(random.UniformInt(500));
  }
  for (float& value : observations.state) value = static_cast<float>(random.Uniform(-1.0, 1.0));
  return observations;
}

std::vector<env::Action> Act(env::Agent& agent, const env::ObservationBatch& observations) {
  std::vector<env::Action> actions(observations.batch_size);
  agent.Act(observations, env::NumbersOf(actions));
  return actions;
}

MpcConfig Config() {
  return {.enabled = true, .samples = 200, .noise = 0.5, .temperature = 0.05, .learning_starts = 0};
}

TEST(MpcAgent, WithOneSequenceIsThePolicy) {
  const PolicySnapshot snapshot = MakeSnapshot({});
  MpcConfig config = Config();
  config.samples = 1;
  MpcAgent agent(config, snapshot, 1);
  NetworkAgent policy(snapshot);
  const env::ObservationBatch observations = Observations(5, 1);
  EXPECT_EQ(Act(agent, observations), Act(policy, observations));
}

TEST(MpcAgent, BeatsThePolicyWhereTheModelShowsABetterAction) {
  const PolicySnapshot snapshot = MakeSnapshot({});
  const env::ObservationBatch observations = Observations(20, 1);
  const float by_policy = static_cast<float>(std::tanh(-0.5));
  for (const PlanUpdate update : test::EveryValue<PlanUpdate>()) {
    MpcConfig config = Config();
    config.update = update;
    MpcAgent once(config, snapshot, 1);
    double mean = 0.0;
    for (const env::Action action : Act(once, observations)) mean += action.linear / 20.0;
    EXPECT_GT(mean, by_policy + 0.2) << base::EnumName(update);
    // Further rounds climb on towards the best, which is 1.
    config.iterations = 6;
    MpcAgent often(config, snapshot, 1);
    double later = 0.0;
    for (const env::Action action : Act(often, observations)) later += action.linear / 20.0;
    EXPECT_GT(later, 0.6) << base::EnumName(update);
    EXPECT_GT(later, mean) << base::EnumName(update);
  }
}

// Two sequences, one of them the policy's own: the returns follow by hand. The first reward is x,
// the same for both. With a horizon of one step the value of the next state, x + 0.5 a, tells them
// apart; with two and no value, the second reward, x + 0.5 a. Both are discounted once. MPPI's
// action is a_0 + w (a_1 - a_0), w = 1 / (1 + e^(-(R_1 - R_0) / temperature)).
TEST(MpcAgent, WeighsByReturn) {
  for (const auto& [alive, horizon] : {std::pair{1.0, 1}, {0.25, 1}, {1.0, 2}, {0.25, 2}}) {
    Hand hand;
    hand.value = horizon == 1 ? 3.0 : 0.0;
    hand.gamma = 0.8;
    hand.termination_logit = std::log((1.0 - alive + 1e-12) / alive);
    MpcConfig config = Config();
    config.horizon = horizon;
    config.samples = 2;
    config.temperature = 0.3;
    const env::ObservationBatch observations = Observations(1, 4);
    const double policy = std::tanh(hand.bias);
    // At a very low temperature the better of the two stays, which gives a_1 or a_0 away; of the
    // seeds one is taken where that is a_1.
    MpcConfig cold = config;
    cold.temperature = 1e-6;
    int num_better = 0;
    for (std::uint64_t seed = 1; seed < 20; ++seed) {
      MpcAgent greedy(cold, MakeSnapshot(hand), seed);
      const double other = static_cast<double>(Act(greedy, observations)[0].linear);
      if (other < policy + 1e-3) continue;
      ++num_better;
      const double factor = horizon == 1 ? hand.value : 1.0;
      const double gain = 0.8 * alive * factor * 0.5 * (other - policy);
      const double weight = 1.0 / (1.0 + std::exp(-gain / 0.3));
      MpcAgent agent(config, MakeSnapshot(hand), seed);
      EXPECT_NEAR(Act(agent, observations)[0].linear, policy + weight * (other - policy), 1e-4)
          << "alive " << alive << ", horizon " << horizon;
    }
    EXPECT_GT(num_better, 3);
  }
}

/// Plans with the networks of `hand` as mpc_agent.h says, written out in double precision.
env::Action WrittenPlan(const MpcConfig& config, const Hand& hand,
                        const env::ObservationBatch& observation, std::uint64_t seed) {
  const PolicySpec spec = MakeSnapshot(hand).spec;
  std::vector<float> frame(kFrame);
  nn::FeatureMap(spec.observation, spec.network).PushFrames(observation, 1, frame.data());
  const env::FrameView view = observation.frame(0);
  const std::uint64_t checksum =
      base::Checksum(std::as_bytes(view.state), base::Checksum(std::as_bytes(view.ranges_cm)));
  base::Random random(base::DeriveSeed(base::DeriveSeed(seed, "planning"), "plan", {checksum}));
  const auto num_steps = static_cast<std::size_t>(config.horizon);
  const auto num_samples = static_cast<std::size_t>(config.samples);
  using Pair = std::array<double, 2>;
  std::vector<Pair> mean(num_steps), deviation(num_steps, {config.noise, config.noise});
  std::vector<std::vector<Pair>> action(num_steps, std::vector<Pair>(num_samples));
  std::vector<double> weight(num_samples);
  for (int round = 0; round < config.iterations; ++round) {
    std::vector<double> x(num_samples, frame[kGoal]), alive(num_samples, 1.0), value(num_samples);
    double discount = 1.0;
    for (std::size_t t = 0; t < num_steps; ++t) {
      for (std::size_t s = 0; s < num_samples; ++s) {
        const Pair centre =
            round == 0 ? Pair{std::tanh(hand.bias + hand.follow * x[s]), 0.0} : mean[t];
        for (const std::size_t i : {0, 1}) {
          const double noise = (s == 0 ? 0.0 : deviation[t][i]) * random.Normal();
          action[t][s][i] = std::clamp(centre[i] + noise, -1.0, 1.0);
        }
      }
      std::ignore = random.UniformInt(1);  // The member of the ensemble.
      for (std::size_t s = 0; s < num_samples; ++s) {
        value[s] += discount * alive[s] * x[s];
        alive[s] /= 1.0 + std::exp(hand.termination_logit + hand.termination_by_x * x[s]);
        x[s] += 0.5 * action[t][s][0];
      }
      discount *= hand.gamma;
    }
    for (std::size_t s = 0; s < num_samples; ++s)
      value[s] += discount * alive[s] * hand.value * x[s];
    std::vector<double> sorted = value;
    std::ranges::sort(sorted, std::greater());
    const std::size_t num_best = std::lround(config.elite_fraction * config.samples);
    for (std::size_t s = 0; s < num_samples; ++s) {
      weight[s] = config.update == PlanUpdate::kCem
                      ? value[s] >= sorted[num_best - 1]
                      : std::exp((value[s] - sorted[0]) / config.temperature);
    }
    const double total = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (double& w : weight) w /= total;
    for (std::size_t t = 0; t < num_steps; ++t) {
      for (const std::size_t i : {0, 1}) {
        double sum = 0.0, squares = 0.0;
        for (std::size_t s = 0; s < num_samples; ++s) sum += weight[s] * action[t][s][i];
        for (std::size_t s = 0; s < num_samples; ++s) {
          squares += weight[s] * (action[t][s][i] - sum) * (action[t][s][i] - sum);
        }
        mean[t][i] = sum;
        if (config.update == PlanUpdate::kCem) deviation[t][i] = std::max(0.01, std::sqrt(squares));
      }
    }
  }
  Pair chosen = mean[0];
  if (config.update == PlanUpdate::kSample) {
    double left = random.Uniform();
    std::size_t s = 0;
    while (s + 1 < num_samples && left >= weight[s]) left -= weight[s++];
    chosen = action[0][s];
  }
  return {static_cast<float>(chosen[0]), static_cast<float>(chosen[1])};
}

// Steps differ in their ends, in the policy's action and, from the second round on, in the spread
// of the samples. The plan of one observation after another leaves nothing behind.
TEST(MpcAgent, PlansAsWrittenOut) {
  const Hand hand{.follow = 0.7,
                  .value = 0.5,
                  .termination_logit = -1.0,
                  .termination_by_x = 2.0,
                  .gamma = 0.8};
  for (const PlanUpdate update : test::EveryValue<PlanUpdate>()) {
    MpcConfig config = Config();
    config.update = update;
    config.horizon = 4;
    config.samples = 30;
    config.iterations = 3;
    config.elite_fraction = 0.2;
    Hand before = hand;
    before.bias = 0.2;
    before.value = -1.0;
    before.termination_by_x = 0.0;
    MpcAgent agent(config, MakeSnapshot(before), 7);
    agent.SetSnapshot(MakeSnapshot(hand));
    for (const std::uint64_t seed : {1, 2, 3}) {
      const env::ObservationBatch observation = Observations(1, seed);
      const env::Action action = Act(agent, observation)[0];
      const env::Action expected = WrittenPlan(config, hand, observation, 7);
      EXPECT_NEAR(action.linear, expected.linear, 1e-4) << base::EnumName(update) << " " << seed;
      EXPECT_NEAR(action.angular, expected.angular, 1e-4) << base::EnumName(update) << " " << seed;
    }
  }
}

// Otherwise the rounds after it would search nothing.
TEST(ActionSamples, APlanOfEqualSamplesStillSearches) {
  ActionSamples samples(1, 2);
  std::ranges::fill(samples.actions, env::Action{0.3f, -0.2f});
  std::ranges::fill(samples.weights, 0.5f);
  ActionPlan plan(1);
  FitPlan(samples, plan);
  EXPECT_EQ(plan.deviation[0], (env::Action{0.01f, 0.01f}));
}

// Where the first step ends it all, nothing that lies ahead counts: all weights are alike.
TEST(MpcAgent, NothingCountsAfterTheEnd) {
  Hand hand;
  hand.termination_logit = 30.0;
  MpcConfig config = Config();
  config.samples = 4000;
  MpcAgent agent(config, MakeSnapshot(hand), 1);
  // Clipped at 1, which is 2.9 deviations away, the mean stays; 0.5 / sqrt(4000) is 0.008; four.
  EXPECT_NEAR(Act(agent, Observations(1, 1))[0].linear, std::tanh(-0.5), 0.04);
}

TEST(MpcAgent, DependsOnWhatItSeesAlone) {
  const env::ObservationBatch five = Observations(5, 1);
  MpcAgent a(Config(), MakeSnapshot({}), 1), b(Config(), MakeSnapshot({}), 1),
      c(Config(), MakeSnapshot({}), 2);
  const std::vector<env::Action> actions = Act(a, five);
  EXPECT_EQ(actions, Act(b, five));
  EXPECT_NE(actions, Act(c, five));
  EXPECT_NE(actions[0], actions[1]);
  // The last environment alone, in another place, after other episodes.
  env::ObservationBatch one;
  one.Resize(1, kBeams);
  std::copy_n(five.ranges_cm.data() + 4 * kBeams, kBeams, one.ranges_cm.data());
  std::copy_n(five.state.data() + 4 * env::kStateSize, env::kStateSize, one.state.data());
  Act(b, Observations(1, 9));
  EXPECT_EQ(Act(b, one)[0], actions[4]);
}

TEST(MpcAgent, GoesOnWithOtherWeights) {
  Hand eager;
  eager.bias = 0.3;
  MpcConfig config = Config();
  config.samples = 1;
  MpcAgent agent(config, MakeSnapshot({}), 1);
  const env::ObservationBatch observations = Observations(1, 1);
  EXPECT_NEAR(Act(agent, observations)[0].linear, std::tanh(-0.5), 1e-6);
  agent.SetSnapshot(MakeSnapshot(eager));
  EXPECT_NEAR(Act(agent, observations)[0].linear, std::tanh(0.3), 1e-6);
}

TEST(MpcAgent, DoesNotPlanWithAModelThatHasLearnedLittle) {
  MpcConfig config = Config();
  config.learning_starts = 10;
  PolicySnapshot snapshot = MakeSnapshot({});
  snapshot.version = 9;
  NetworkAgent policy(snapshot);
  const std::unique_ptr<PolicyAgent> agent = MakePolicyAgent(snapshot, config, 1);
  const env::ObservationBatch observations = Observations(3, 1);
  EXPECT_EQ(Act(*agent, observations), Act(policy, observations));
  snapshot.version = 10;
  agent->SetSnapshot(snapshot);
  EXPECT_NE(Act(*agent, observations), Act(policy, observations));
}

TEST(MpcAgent, AsPublishedIsThePolicyWithNoiseUnscaled) {
  MpcConfig config = Config();
  config.no_planning = true;
  config.noise = 0.1;
  MpcAgent agent(config, MakeSnapshot({}), 1);
  double sum = 0.0, squares = 0.0;
  const std::vector<env::Action> actions = Act(agent, Observations(1000, 1));
  for (const env::Action action : actions) {
    const double offset = static_cast<double>(action.linear) - std::tanh(-0.5);
    sum += offset;
    squares += offset * offset;
  }
  // Of a thousand draws with deviation 0.1: the mean within 0.003, the deviation within 0.0022;
  // four.
  EXPECT_NEAR(sum / 1000, 0.0, 0.013);
  EXPECT_NEAR(std::sqrt(squares / 1000), 0.1, 0.009);
  config.unscaled_action = true;
  MpcAgent unscaled(config, MakeSnapshot({}), 1);
  const env::Action taken = Act(unscaled, Observations(1000, 1))[0];
  const env::ActionBounds bounds;
  EXPECT_NEAR(bounds.linear_mps(taken), actions[0].linear, 1e-6);
  EXPECT_NEAR(bounds.angular_radps(taken), actions[0].angular, 1e-6);
}

TEST(MpcAgent, RefusesAPolicyWithoutAModel) {
  PolicySnapshot snapshot = MakeSnapshot({});
  snapshot.critic_weights = nullptr;
  EXPECT_THROW(MpcAgent(Config(), snapshot, 1), base::Error);
  snapshot = MakeSnapshot({});
  snapshot.spec.planning = {};
  try {
    MpcAgent(Config(), snapshot, 1);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("no transition model"));
  }
  MpcConfig config = Config();
  config.update = PlanUpdate::kCem;
  config.samples = 10;
  EXPECT_THROW(MpcAgent(config, MakeSnapshot({}), 1), base::Error);
}

TEST(Policy, CarriesModelAndCritic) {
  PolicySnapshot snapshot = MakeSnapshot({});
  snapshot.spec.planning.model.ensemble = 2;
  std::vector<float> both = *snapshot.model_weights;
  both.insert(both.end(), both.begin(), both.end());
  both.back() = 5.0f;
  snapshot.model_weights = std::make_shared<const std::vector<float>>(both);
  const std::string bytes = PrintPolicy(snapshot, {});
  const PolicySnapshot read = ParsePolicy(std::as_bytes(std::span(bytes)), "memory").snapshot;
  EXPECT_EQ(read.spec.planning, snapshot.spec.planning);
  EXPECT_EQ(*read.weights, *snapshot.weights);
  EXPECT_EQ(*read.model_weights, both);
  EXPECT_EQ(*read.critic_weights, *snapshot.critic_weights);
  nn::TensorFile file = nn::ParseTensors(std::as_bytes(std::span(bytes)), "memory");
  file.tensors.erase("model.1.head.0.bias");
  const std::string damaged = nn::PrintTensors(file.tensors, file.metadata);
  EXPECT_THROW(ParsePolicy(std::as_bytes(std::span(damaged)), "memory"), base::Error);
}

}  // namespace
}  // namespace slalom::policy
