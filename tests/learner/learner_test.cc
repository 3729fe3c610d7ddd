#include "learner/learner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "learner/algorithm.h"
#include "learner/ddpg.h"
#include "learner/sac.h"
#include "learner/td3.h"
#include "policy/nn/feature_map.h"
#include "tests/learner/every_algorithm.h"
#include "tests/learner/random_rows.h"

namespace slalom::learner {
namespace {

policy::PolicySpec SmallSpec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = 24;
  spec.network.encoder_layers = {16};
  spec.network.head_layers = {16};
  spec.network.sectors = 12;
  spec.network.layer_norm = true;
  return spec;
}

MethodConfig SmallConfig() {
  MethodConfig config;
  config.learner.device = DeviceChoice::kCpu;
  config.learner.batch_size = 16;
  config.learner.actor_learning_rate = 1e-3;
  config.learner.critic_learning_rate = 1e-3;
  config.learner.mirror = true;
  config.learner.average_rate = 0.01;
  return config;
}

void Train(Learner& learner, int begin, int end) {
  for (int i = begin; i < end; ++i) {
    learner.Update(RandomRows(16, 1, 24, 100 + i).batches(), i / 100.0);
  }
}

nn::TensorFile Saved(const Learner& learner) {
  nn::TensorFile file;
  file.source = "memory";
  learner.SaveState(file.tensors);
  return file;
}

TEST(Learner, IsAFunctionOfItsSeed) {
  Learner a(SmallConfig(), SmallSpec(), 5), b(SmallConfig(), SmallSpec(), 5),
      c(SmallConfig(), SmallSpec(), 6);
  for (Learner* learner : {&a, &b, &c}) Train(*learner, 0, 10);
  EXPECT_EQ(Saved(a).tensors, Saved(b).tensors);
  EXPECT_NE(*a.Snapshot().weights, *c.Snapshot().weights);
}

TEST(Learner, GoesOnBitForBitAfterARestore) {
  // 7 is odd, so the next update is one of those that move the actor.
  Learner whole(SmallConfig(), SmallSpec(), 5);
  Train(whole, 0, 7);
  Learner resumed(SmallConfig(), SmallSpec(), 99);
  resumed.LoadState(Saved(whole));
  Train(whole, 7, 20);
  Train(resumed, 7, 20);
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
  EXPECT_EQ(*whole.BestSnapshot().weights, *resumed.BestSnapshot().weights);
  EXPECT_EQ(whole.ReadStats().critic_loss, resumed.ReadStats().critic_loss);
}

TEST(Learner, RefusesStateOfAnotherNetwork) {
  Learner learner(SmallConfig(), SmallSpec(), 5);
  policy::PolicySpec other = SmallSpec();
  other.network.head_layers = {8};
  EXPECT_THROW(learner.LoadState(Saved(Learner(SmallConfig(), other, 5))), base::Error);
  nn::TensorFile incomplete = Saved(learner);
  incomplete.tensors.erase("critics.adam.second_moment");
  EXPECT_THROW(learner.LoadState(incomplete), base::Error);
}

TEST(Learner, TargetsStandStillBetweenActorUpdates) {
  Learner learner(SmallConfig(), SmallSpec(), 5);
  const nn::TensorMap before = Saved(learner).tensors;
  EXPECT_EQ(before.at("critics.parameters"), before.at("critics.target_parameters"));
  EXPECT_EQ(before.at("actor.parameters"), before.at("actor.target_parameters"));
  Train(learner, 0, 1);
  const nn::TensorMap after_one = Saved(learner).tensors;
  EXPECT_NE(after_one.at("critics.parameters"), before.at("critics.parameters"));
  for (const char* name : {"critics.target_parameters", "actor.parameters",
                           "actor.target_parameters", "actor.average_parameters"}) {
    EXPECT_EQ(after_one.at(name), before.at(name)) << name;
  }
  Train(learner, 1, 2);
  const nn::TensorMap after_two = Saved(learner).tensors;
  for (const char* name : {"critics.target_parameters", "actor.parameters",
                           "actor.target_parameters", "actor.average_parameters"}) {
    EXPECT_NE(after_two.at(name), before.at(name)) << name;
  }
}

/// An algorithm whose networks can be looked at.
template <class Method>
class Opened : public Method {
 public:
  using Method::Method;

  /// The learned parameters, the target networks and the averages.
  std::vector<at::Tensor> Parameters() const {
    const auto& actor = this->actor_;
    std::vector<at::Tensor> all = {actor.parameters(), actor.average_parameters(),
                                   this->critics_.parameters(), this->critics_.target_parameters()};
    if constexpr (requires { actor.target_parameters(); }) all.push_back(actor.target_parameters());
    return all;
  }
};

template <class Method>
class AveragesTest : public testing::Test {};
using Algorithms = testing::Types<Td3, Ddpg, Sac>;
TYPED_TEST_SUITE(AveragesTest, Algorithms);

TYPED_TEST(AveragesTest, ShareNoStorageWithTheParameters) {
  MethodConfig method = SmallConfig();
  method.learner.algorithm = std::is_same_v<TypeParam, Sac> ? "sac" : "td3";
  policy::PolicySpec spec = SmallSpec();
  spec.distribution = DistributionOf(method.learner);
  const int frame_size = nn::FeatureMap(spec.observation, spec.network).frame_size();
  base::Random random(1);
  Minibatch minibatch(16, 1, frame_size, at::kCPU);
  Totals totals(at::kCPU);
  const Opened<TypeParam> algorithm({.config = method.learner,
                                     .spec = spec,
                                     .initial_weights = random,
                                     .minibatch = minibatch,
                                     .totals = totals,
                                     .constraint = nullptr});
  const std::vector<at::Tensor> all = algorithm.Parameters();
  EXPECT_EQ(all.size(), (std::is_same_v<TypeParam, Sac> ? 4u : 5u));
  const auto begin = [](const at::Tensor& t) {
    return reinterpret_cast<std::uintptr_t>(t.data_ptr());
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_TRUE(all[i].is_contiguous());
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_TRUE(begin(all[i]) + all[i].nbytes() <= begin(all[j]) ||
                  begin(all[j]) + all[j].nbytes() <= begin(all[i]))
          << i << " " << j;
    }
  }
}

// avg <- avg + max(rate, 5 / (5 + n)) (phi - avg) in the n-th update of the actor.
TEST(Learner, AveragesItsLastPolicies) {
  for (const char* algorithm : {"ddpg", "sac"}) {  // Each update is one of the actor.
    MethodConfig config = SmallConfig();
    config.learner.algorithm = algorithm;
    config.learner.average_rate = 0.4;  // Reached in the eighth.
    policy::PolicySpec spec = SmallSpec();
    spec.distribution = DistributionOf(config.learner);
    Learner learner(config, spec, 5);
    const auto read = [&](const char* name) {
      const nn::StoredTensor stored = Saved(learner).tensors.at(name);
      std::vector<float> numbers(stored.bytes.size() / sizeof(float));
      std::memcpy(numbers.data(), stored.bytes.data(), stored.bytes.size());
      return numbers;
    };
    std::vector<float> expected = read("actor.parameters");
    for (int n = 1; n <= 12; ++n) {
      Train(learner, n, n + 1);
      const float rate = std::max(0.4f, 5.0f / (5.0f + static_cast<float>(n)));
      const std::vector<float> actor = read("actor.parameters");
      for (std::size_t i = 0; i < actor.size(); ++i) expected[i] += rate * (actor[i] - expected[i]);
      EXPECT_THAT(read("actor.average_parameters"),
                  testing::Pointwise(testing::FloatNear(1e-6f), expected))
          << algorithm << " " << n;
    }
  }
}

TEST(Learner, LearningRatesFallWithProgress) {
  for (const char* algorithm : EveryAlgorithm()) {
    MethodConfig config = SmallConfig();
    config.learner.algorithm = algorithm;
    config.learner.final_learning_rate_fraction = 0.0;
    config.constraint = {.kind = ConstraintKind::kFixed, .multiplier = 1.0};
    policy::PolicySpec spec = SmallSpec();
    spec.distribution = DistributionOf(config.learner);
    Learner learner(config, spec, 5);
    const nn::TensorMap before = Saved(learner).tensors;
    // Two updates, as TD3's actor is due in the second.
    for (int i = 0; i < 2; ++i) {
      learner.Update(RandomRows(16, 1, 24, 1 + i).batches(), /*progress=*/1.0);
    }
    for (const char* name : {"critics.parameters", "actor.parameters", "cost_critics.parameters"}) {
      EXPECT_EQ(Saved(learner).tensors.at(name), before.at(name)) << algorithm << " " << name;
    }
  }
}

TEST(Learner, StartsFromTheActorOfAPolicyAndNothingElse) {
  for (const char* algorithm : {"td3", "sac", "distillation"}) {
    SCOPED_TRACE(algorithm);
    MethodConfig config = SmallConfig();
    config.learner.algorithm = algorithm;
    policy::PolicySpec spec = SmallSpec();
    spec.distribution = DistributionOf(config.learner);
    const policy::PolicySnapshot first = Learner(config, spec, 7).Snapshot();
    const Learner random(config, spec, 5), started(config, spec, 5, first);
    EXPECT_EQ(*started.Snapshot().weights, *first.weights);
    EXPECT_EQ(*started.BestSnapshot().weights, *first.weights);
    EXPECT_EQ(started.num_updates(), 0);
    const nn::TensorMap others = Saved(random).tensors;
    for (const auto& [name, tensor] : Saved(started).tensors) {
      const bool is_actor =
          name.starts_with("actor.") && name.find("parameters") != std::string::npos;
      EXPECT_EQ(tensor == others.at(name), !is_actor) << name;
      if (!is_actor) continue;
      EXPECT_EQ(tensor, Saved(started).tensors.at("actor.parameters")) << name;
    }
  }
}

TEST(Learner, ReportsItsLearningRates) {
  for (const char* algorithm : {"td3", "sac", "distillation"}) {
    SCOPED_TRACE(algorithm);
    MethodConfig config = SmallConfig();
    config.learner.algorithm = algorithm;
    config.learner.final_learning_rate_fraction = 0.2;
    config.learner.actor_learning_rate = 0.01;
    config.learner.critic_learning_rate = 0.03;
    policy::PolicySpec spec = SmallSpec();
    spec.distribution = DistributionOf(config.learner);
    Learner learner(config, spec, 5);
    EXPECT_TRUE(std::isnan(learner.ReadStats().actor_learning_rate)) << "before the first update";
    learner.Update(RandomRows(16, 1, 24, 1).batches(), /*progress=*/0.75);
    for (int reading = 0; reading < 2; ++reading) {
      const LearnerStats stats = learner.ReadStats();
      EXPECT_DOUBLE_EQ(stats.actor_learning_rate, 0.01 * 0.4);
      if (TraitsOf(config.learner).is_taught) {
        EXPECT_TRUE(std::isnan(stats.critic_learning_rate));
      } else {
        EXPECT_DOUBLE_EQ(stats.critic_learning_rate, 0.03 * 0.4);
      }
    }
  }
}

TEST(Learner, ReportsNumbersThatAreNotFinite) {
  Learner learner(SmallConfig(), SmallSpec(), 5);
  Train(learner, 0, 4);
  EXPECT_TRUE(learner.healthy());
  RandomRows bad(16, 1, 24, 1);
  bad.rows.n_step_return[3] = std::numeric_limits<float>::quiet_NaN();
  learner.Update(bad.batches(), 0.0);
  ASSERT_FALSE(learner.healthy());
  EXPECT_THAT(*learner.FindFault(), testing::HasSubstr("critics"));
}

TEST(Learner, HasNoFiguresWhereThereWasNoUpdate) {
  Learner learner(SmallConfig(), SmallSpec(), 5);
  EXPECT_TRUE(std::isnan(learner.ReadStats().critic_loss));
  Train(learner, 0, 10);
  EXPECT_GT(learner.ReadStats().critic_loss, 0.0);
  const LearnerStats idle = learner.ReadStats();
  for (const double figure : {idle.critic_loss, idle.q_mean, idle.actor_q_mean,
                              idle.critic_gradient_norm, idle.actor_gradient_norm}) {
    EXPECT_TRUE(std::isnan(figure));
  }
  EXPECT_EQ(learner.FindFault(), std::nullopt);
}

// The mean of two readings, of ten updates each, is that of one reading of both.
TEST(Learner, FiguresAreOfTheUpdatesSinceTheLastReading) {
  Learner often(SmallConfig(), SmallSpec(), 5), once(SmallConfig(), SmallSpec(), 5);
  Train(often, 0, 10);
  const LearnerStats first = often.ReadStats();
  Train(often, 10, 20);
  const LearnerStats second = often.ReadStats();
  Train(once, 0, 20);
  const LearnerStats all = once.ReadStats();
  for (double LearnerStats::*const figure :
       {&LearnerStats::critic_loss, &LearnerStats::q_mean, &LearnerStats::critic_gradient_norm,
        &LearnerStats::actor_q_mean, &LearnerStats::actor_gradient_norm}) {
    EXPECT_NEAR(0.5 * (first.*figure + second.*figure), all.*figure, 1e-9 * std::abs(all.*figure));
    EXPECT_NE(first.*figure, second.*figure);
  }
}

TEST(Learner, ReportsValuesBeyondTheLimit) {
  MethodConfig config = SmallConfig();
  config.learner.divergence_limit = 1.0;
  config.learner.reward_scale = 1000.0;
  config.learner.critic_learning_rate = 0.1;
  Learner learner(config, SmallSpec(), 5);
  Train(learner, 0, 50);
  learner.ReadStats();
  ASSERT_FALSE(learner.healthy());
  EXPECT_THAT(*learner.FindFault(), testing::HasSubstr("divergence_limit"));
}

TEST(Learner, WithoutAveragingTheAverageIsTheActor) {
  MethodConfig config = SmallConfig();
  config.learner.average_rate = 0.0;
  Learner learner(config, SmallSpec(), 5);
  Train(learner, 0, 4);
  EXPECT_EQ(*learner.BestSnapshot().weights, *learner.Snapshot().weights);
  EXPECT_EQ(learner.Snapshot().version, 4);
}

MethodConfig Prioritized(MethodConfig config) {
  config.learner.prioritized = true;
  return config;
}

TEST(Learner, WeightsOfOneChangeNothing) {
  Learner uniform(SmallConfig(), SmallSpec(), 5),
      prioritized(Prioritized(SmallConfig()), SmallSpec(), 5);
  for (Learner* learner : {&uniform, &prioritized}) Train(*learner, 0, 10);
  EXPECT_EQ(*uniform.Snapshot().weights, *prioritized.Snapshot().weights);
}

std::vector<float> Saved(const Learner& learner, const char* name) {
  const nn::TensorFile file = Saved(learner);
  std::vector<float> values(file.tensors.at(name).bytes.size() / sizeof(float));
  file.Read(name, std::span(values));
  return values;
}

// A batch in which half of the samples weigh nothing teaches what the other half alone does, at
// half the size of the gradient, which Adam does not see: its step is the same but for epsilon.
TEST(Learner, SamplesCountByTheirWeights) {
  MethodConfig config = Prioritized(SmallConfig());
  config.constraint.kind = ConstraintKind::kLagrangian;
  config.learner.mirror = false;
  config.learner.target_noise = 0.0;
  Learner whole(config, SmallSpec(), 5);
  RandomRows rows(16, 1, 24, 1);
  for (int i = 8; i < 16; ++i) rows.rows.weight[i] = 0.0f;
  config.learner.batch_size = 8;
  Learner half(config, SmallSpec(), 5), untrained(config, SmallSpec(), 5);
  RandomRows first(16, 1, 24, 1);
  first.rows.batch = 8;
  whole.Update(rows.batches(), 0.0);
  half.Update(first.batches(), 0.0);
  for (const char* name : {"critics.parameters", "cost_critics.parameters"}) {
    const auto a = Saved(whole, name), b = Saved(half, name);
    ASSERT_EQ(a.size(), b.size());
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    }
    // A step is at most the learning rate, 1e-3. Where a gradient g is not far above Adam's
    // epsilon, halving it changes the step by up to epsilon / g of it.
    EXPECT_LT(largest, 1e-3 * 0.1) << name;
    EXPECT_NE(Saved(untrained, name), b) << name << ": the update did nothing";
  }
}

TEST(Learner, ErrorsAreThoseOfTheCritics) {
  MethodConfig config = Prioritized(SmallConfig());
  config.learner.mirror = false;
  config.learner.critic_learning_rate = 0.0;
  Learner learner(config, SmallSpec(), 5);
  RandomRows rows(16, 1, 24, 1);
  // Where the window ended, y is the reward alone: a reward that is larger by 3 moves the error so.
  learner.Update(rows.batches(), 0.0);
  const std::vector<float> before(learner.TdErrors().begin(), learner.TdErrors().end());
  for (int i = 0; i < 16; ++i) rows.rows.n_step_return[i] += 30.0f;
  learner.Update(rows.batches(), 0.0);
  const auto after = learner.TdErrors();
  for (int i = 0; i < 16; i += 4) {
    ASSERT_EQ(rows.rows.discount[i], 0.0f);
    // |q - (r + 30)| with |q - r| < 30: 30 - (q - r), and before it was |q - r|.
    EXPECT_NEAR(
        std::min(std::abs(after[i] - 30.0f - before[i]), std::abs(after[i] - 30.0f + before[i])),
        0.0, 0.5)
        << i;
    EXPECT_GT(after[i], 20.0f);
  }
}

/// A spec and config of each algorithm, constrained, so that everything has state.
class MethodTest : public testing::TestWithParam<const char*> {
 protected:
  MethodTest() {
    method_.learner.algorithm = GetParam();
    method_.constraint = {.kind = ConstraintKind::kLagrangian,
                          .limit = 0.1,
                          .multiplier = 1.0,
                          .proportional_gain = 0.5,
                          .derivative_gain = 0.5};
    spec_.distribution = DistributionOf(method_.learner);
  }

  MethodConfig method_ = SmallConfig();
  policy::PolicySpec spec_ = SmallSpec();
};

TEST_P(MethodTest, GoesOnBitForBitAfterARestore) {
  Learner whole(method_, spec_, 5);
  Train(whole, 0, 7);
  whole.ObserveEpisodes(0.5, 70);
  Learner resumed(method_, spec_, 99);
  resumed.LoadState(Saved(whole));
  for (Learner* learner : {&whole, &resumed}) {
    Train(*learner, 7, 20);
    learner->ObserveEpisodes(0.7, 20);
  }
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
  EXPECT_NE(whole.ReadStats().constraint_multiplier, 1.0);
}

TEST_P(MethodTest, AnyNumberOfThreadsGivesTheSameBits) {
  method_.learner.threads = 2;
  Learner two(method_, spec_, 5);
  Train(two, 0, 50);
  for (const int threads : {3, 4}) {
    method_.learner.threads = threads;
    Learner more(method_, spec_, 5);
    Train(more, 0, 50);
    EXPECT_EQ(Saved(two).tensors, Saved(more).tensors) << threads;
  }
}

TEST_P(MethodTest, ThreadsGoOnBitForBitAfterARestore) {
  method_.learner.threads = 2;
  Learner whole(method_, spec_, 5), resumed(method_, spec_, 99);
  Train(whole, 0, 7);
  resumed.LoadState(Saved(whole));
  for (Learner* learner : {&whole, &resumed}) Train(*learner, 7, 20);
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
}

TEST_P(MethodTest, ASnapshotIsAPolicyThatLoads) {
  Learner learner(method_, spec_, 5);
  Train(learner, 0, 3);
  const policy::PolicySnapshot snapshot = learner.Snapshot();
  const std::string bytes = policy::PrintPolicy(snapshot, {});
  const policy::LoadedPolicy loaded =
      policy::ParsePolicy(std::as_bytes(std::span(bytes)), "memory");
  EXPECT_EQ(*loaded.snapshot.weights, *snapshot.weights);
  EXPECT_EQ(loaded.snapshot.spec.distribution, spec_.distribution);
}

// mean (Q_C - 1)^2 - mean Q_C^2 = 1 - 2 mean Q_C, for any cost critics: costs of 0 and of 1 where
// every window ended show that loss and value are of one critic, however many the algorithm has.
TEST_P(MethodTest, CostFiguresAreThoseOfOneCritic) {
  method_.learner.critic_learning_rate = 0.0;
  const auto stats = [&](float cost) {
    Learner learner(method_, spec_, 5);
    RandomRows rows(16, 1, 24, 1);
    for (int i = 0; i < 16; ++i) {
      rows.rows.cost_return[i] = cost;
      rows.rows.discount[i] = 0.0f;
    }
    learner.Update(rows.batches(), 0.0);
    return learner.ReadStats();
  };
  const LearnerStats none = stats(0.0f), all = stats(1.0f);
  EXPECT_NE(none.cost_q_mean, 0.0);
  EXPECT_EQ(none.cost_q_mean, all.cost_q_mean);
  EXPECT_NEAR(all.cost_critic_loss - none.cost_critic_loss, 1.0 - 2.0 * none.cost_q_mean, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Algorithms, MethodTest, testing::ValuesIn(EveryAlgorithm()),
                         [](const auto& algorithm) { return std::string(algorithm.param); });

/// Rows whose action follows from the state: what a teacher showed.
struct TaughtRows : RandomRows {
  explicit TaughtRows(std::uint64_t seed) : RandomRows(64, 1, 24, seed) {
    for (std::size_t i = 0; i < 64; ++i) {
      rows.action[2 * i] = 0.8f * rows.state[4 * i];
      rows.action[2 * i + 1] = -0.5f * rows.state[4 * i + 1];
    }
  }
};

MethodConfig Taught() {
  MethodConfig method = SmallConfig();
  method.learner.algorithm = "distillation";
  method.learner.batch_size = 64;
  method.learner.actor_learning_rate = 1e-2;
  return method;
}

TEST(Distillation, LearnsTheTeachersActionsAndNothingElse) {
  Learner learner(Taught(), SmallSpec(), 5);
  const auto train = [&](int begin, int end) {
    for (int i = begin; i < end; ++i) learner.Update(TaughtRows(i).batches(), 0.0);
    return learner.ReadStats();
  };
  // The state is uniform in +-1, of which the actions have the mean squares 0.64 / 3 + 0.25 / 3.
  EXPECT_LT(train(0, 1).actor_q_mean, -0.2);
  train(1, 1500);
  const LearnerStats stats = train(1500, 1600);
  EXPECT_GT(stats.actor_q_mean, -0.02);
  EXPECT_LE(stats.actor_q_mean, 0.0);
  EXPECT_GT(stats.actor_gradient_norm, 0.0);
  EXPECT_TRUE(std::isnan(stats.critic_loss) && std::isnan(stats.q_mean) &&
              std::isnan(stats.critic_gradient_norm));
  EXPECT_EQ(learner.FindFault(), std::nullopt);
}

TEST(Distillation, GoesOnBitForBitAfterARestore) {
  Learner whole(Taught(), SmallSpec(), 5), resumed(Taught(), SmallSpec(), 99);
  const auto train = [](Learner& learner, int begin, int end) {
    for (int i = begin; i < end; ++i) learner.Update(TaughtRows(i).batches(), i / 100.0);
  };
  train(whole, 0, 7);
  resumed.LoadState(Saved(whole));
  train(whole, 7, 20);
  train(resumed, 7, 20);
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
  EXPECT_EQ(*whole.BestSnapshot().weights, *resumed.BestSnapshot().weights);
}

}  // namespace
}  // namespace slalom::learner
