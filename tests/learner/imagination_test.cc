#include "learner/imagination.h"

#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/learner/linear_world.h"

namespace slalom::learner {
namespace {

constexpr int kBeams = LinearWorld::kBeams;
constexpr int kFrame = kBeams + env::kStateSize;
constexpr int kHistory = 2;
constexpr int kWidth = kHistory * kFrame;
constexpr int kBatch = 8;
constexpr double kGamma = 0.9;

/// A policy that is a known function of the newest frame, in place of an algorithm.
class StandIn : public Algorithm {
 public:
  explicit StandIn(Minibatch& minibatch)
      : minibatch_(minibatch), actions_(at::zeros({kBatch, 2})), none_(at::zeros({1})) {}

  static at::Tensor Act(const at::Tensor& stack) {
    const at::Tensor newest = stack.narrow(1, kWidth - kFrame, kFrame);
    return at::stack({newest.select(1, 0) * 0.5, newest.select(1, 5) * -0.7}, 1).clamp(-1, 1);
  }

  const at::Tensor& ActNext() override {
    actions_.copy_(Act(minibatch_.next_features));
    return actions_;
  }
  void Update(double) override {}
  const at::Tensor& td_errors() const override { return none_; }
  int num_critics() const override { return 1; }
  const at::Tensor& actor_parameters() const override { return none_; }
  const at::Tensor& average_parameters() const override { return none_; }
  const at::Tensor& critic_parameters() const override { return none_; }
  void StartFrom(const at::Tensor&) override {}
  void SaveState(nn::TensorMap&) const override {}
  void LoadState(const nn::TensorFile&) override {}

 private:
  Minibatch& minibatch_;
  at::Tensor actions_, none_;
};

/// A model with random weights, its loaded states, and imagination on them.
struct Scene {
  explicit Scene(const ImaginationConfig& config,
                 nn::ModelKind kind = nn::ModelKind::kDeterministic, std::uint64_t seed = 3)
      : minibatch(kBatch, kHistory, kFrame, at::kCPU),
        algorithm(minibatch),
        trainer(MakeTrainer(kind)),
        imagination(config, kGamma, trainer, algorithm, minibatch, seed) {
    const RandomRows rows(trainer.sample_spec().batch, kHistory, kBeams, 5);
    trainer.Load(rows.rows);
    minibatch.input.fill_(-7.0);
    minibatch.actions.fill_(-7.0);
    minibatch.next_features.fill_(-7.0);
    minibatch.reward.fill_(-7.0);
    minibatch.cost.fill_(1.0);
    minibatch.weight.fill_(0.5);
    minibatch.discount.fill_(0.123);
  }

  static ModelTrainer MakeTrainer(nn::ModelKind kind) {
    env::ObservationSpec observation;
    observation.num_beams = kBeams;
    const nn::NetworkConfig network{.history = kHistory};
    const nn::FeatureMap features(observation, network);
    const nn::TransitionModelConfig model{.kind = kind, .encoder_layers = {}, .head_layers = {16}};
    return {{.batch_size = kBatch, .updates_per_update = 4},
            MakeModelShape(model, network, kFrame),
            features,
            1.0,
            false,
            at::kCPU,
            11};
  }

  /// What the model says of stacks and actions, apart from everything under test.
  struct Outcome {
    at::Tensor next, reward, termination;
  };
  Outcome Predict(const at::Tensor& stack, const at::Tensor& actions) const {
    const at::Tensor input = at::cat({stack, actions}, 1);
    nn::ModelPass pass(trainer.model().shape(), input);
    at::Tensor next = at::zeros({stack.size(0), kWidth});
    trainer.model().Predict(pass, 0, {}, next);
    return {next, pass.reward(), pass.termination()};
  }

  Minibatch minibatch;
  StandIn algorithm;
  ModelTrainer trainer;
  Imagination imagination;
};

void ExpectClose(const at::Tensor& a, const at::Tensor& b) {
  // Products of a few numbers below ten in float32.
  EXPECT_LT((a - b).abs().max().item<double>(), 1e-5);
}

ImaginationConfig Dyna() {
  return {.kind = ImaginationKind::kDyna, .imagined_batches = 3, .rollout_steps = 4, .noise = 0.0};
}

TEST(Imagination, DynaStepsForthAndSumsUp) {
  Scene scene(Dyna());
  scene.imagination.Begin(0);
  for (int k = 0; k < 3; ++k) {
    scene.imagination.Fill(k);
    const at::Tensor start = scene.trainer.loaded().features.narrow(0, k * kBatch, kBatch);
    at::Tensor stack = start.clone();
    at::Tensor value = at::zeros({kBatch}), alive = at::ones({kBatch});
    for (int i = 0; i < 4; ++i) {
      const Scene::Outcome outcome = scene.Predict(stack, StandIn::Act(stack));
      value += std::pow(kGamma, i) * alive * outcome.reward;
      alive = alive * (1 - outcome.termination);
      stack = outcome.next;
    }
    ExpectClose(scene.minibatch.features, start);
    ExpectClose(scene.minibatch.actions, StandIn::Act(start));
    ExpectClose(scene.minibatch.next_features, stack);
    ExpectClose(scene.minibatch.reward, value);
    ExpectClose(scene.minibatch.discount, std::pow(kGamma, 4) * alive);
    EXPECT_EQ(scene.minibatch.cost.abs().max().item<float>(), 0.0f);
    EXPECT_EQ(scene.minibatch.weight.min().item<float>(), 1.0f);
    EXPECT_EQ(scene.imagination.num_transitions(), (k + 1) * 4 * kBatch);
  }
}

TEST(Imagination, AsPublishedDoesNotAdvance) {
  ImaginationConfig config = Dyna();
  config.as_published = true;
  Scene scene(config);
  scene.imagination.Begin(0);
  scene.imagination.Fill(1);
  const at::Tensor start = scene.trainer.loaded().features.narrow(0, kBatch, kBatch);
  const Scene::Outcome outcome = scene.Predict(start, StandIn::Act(start));
  ExpectClose(scene.minibatch.next_features, outcome.next);
  ExpectClose(scene.minibatch.reward, outcome.reward);
  at::Tensor alive = at::ones({kBatch}), discount = at::ones({kBatch});
  for (int i = 0; i < 4; ++i) {
    alive = alive * (1 - outcome.termination);
    discount = discount * at::pow(kGamma, alive);
  }
  ExpectClose(scene.minibatch.discount, discount * alive);
}

TEST(Imagination, NoiseMovesTheFirstActionAndIsClipped) {
  ImaginationConfig config = Dyna();
  config.noise = 5.0;
  Scene scene(config);
  scene.imagination.Begin(0);
  scene.imagination.Fill(0);
  const at::Tensor actions = scene.minibatch.actions.clone();
  EXPECT_LE(actions.abs().max().item<float>(), 1.0f);
  EXPECT_GT((actions - StandIn::Act(scene.minibatch.features)).abs().max().item<float>(), 0.5f);
  scene.imagination.Fill(0);
  EXPECT_GT((actions - scene.minibatch.actions).abs().max().item<float>(), 0.5f);
}

ImaginationConfig Mbpo() {
  return {.kind = ImaginationKind::kMbpo,
          .imagined_batches = 5,
          .rollout_steps = 3,
          .noise = 0.3,
          .rollouts = 4 * kBatch,
          .buffer_capacity = 200,
          .real_ratio = 0.25};
}

TEST(Imagination, MbpoMixesReplayedAndImaginedTransitions) {
  Scene scene(Mbpo());
  for (int i = 0; i < kBatch; ++i) scene.minibatch.reward[i] = 100.0 + i;
  scene.imagination.Begin(0);
  std::vector<int> replayed;
  int num_ended = 0, num_imagined = 0;
  double expected_ended = 0.0;
  for (int k = 0; k < 5; ++k) {
    scene.imagination.Fill(k);
    for (int i = 0; i < 2; ++i) {
      replayed.push_back(static_cast<int>(scene.minibatch.reward[i].item<float>()) - 100);
      EXPECT_EQ(scene.minibatch.features[i][0].item<float>(), -7.0f);
      EXPECT_EQ(scene.minibatch.discount[i].item<float>(), 0.123f);
      EXPECT_EQ(scene.minibatch.weight[i].item<float>(), 0.5f);
      EXPECT_EQ(scene.minibatch.cost[i].item<float>(), 1.0f);
    }
    const auto imagined = [&](const at::Tensor& t) { return t.narrow(0, 2, kBatch - 2); };
    const Scene::Outcome outcome =
        scene.Predict(imagined(scene.minibatch.features), imagined(scene.minibatch.actions));
    ExpectClose(imagined(scene.minibatch.next_features), outcome.next);
    ExpectClose(imagined(scene.minibatch.reward), outcome.reward);
    for (int i = 0; i < kBatch - 2; ++i) {
      const float discount = imagined(scene.minibatch.discount)[i].item<float>();
      EXPECT_TRUE(discount == 0.0f || discount == static_cast<float>(kGamma));
      num_ended += discount == 0.0f;
      ++num_imagined;
      expected_ended += outcome.termination[i].item<double>();
    }
  }
  EXPECT_THAT(replayed, testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 0, 1));
  // Thirty draws with probabilities near a half: deviation 2.7; four of them.
  EXPECT_NEAR(num_ended, expected_ended, 11.0);
  EXPECT_GT(num_ended, 0);
  EXPECT_LT(num_ended, num_imagined);
}

// Every transition in the buffer either begins at a replayed state or where another one led.
TEST(Imagination, RolloutsGoOnFromWhereTheyLed) {
  ImaginationConfig config = Mbpo();
  config.real_ratio = 0.0;
  config.imagined_batches = 60;
  Scene scene(config);
  scene.imagination.Begin(0);
  std::vector<at::Tensor> from, to;
  for (int k = 0; k < 60; ++k) {
    scene.imagination.Fill(k);
    from.push_back(scene.minibatch.features.clone());
    to.push_back(scene.minibatch.next_features.clone());
  }
  const at::Tensor begins = at::cat(from), ends = at::cat(to);
  const at::Tensor starts = scene.trainer.loaded().features.narrow(0, 0, 4 * kBatch);
  const auto is_in = [](const at::Tensor& row, const at::Tensor& rows) {
    return (rows - row).abs().amax(1).min().item<float>() == 0.0f;
  };
  int num_first = 0, num_later = 0;
  for (std::int64_t i = 0; i < begins.size(0); ++i) {
    const bool first = is_in(begins[i], starts);
    num_first += first;
    num_later += !first && is_in(begins[i], ends);
  }
  // 480 draws out of 96 transitions miss one with probability e^-5.
  EXPECT_GT(num_first, begins.size(0) / 4);
  EXPECT_GT(num_later, begins.size(0) / 10);
  EXPECT_GT(num_first + num_later, begins.size(0) * 95 / 100);
}

TEST(Imagination, IsAFunctionOfItsSeedAndGoesOnAfterARestore) {
  for (const nn::ModelKind kind : {nn::ModelKind::kDeterministic, nn::ModelKind::kProbabilistic}) {
    Scene a(Mbpo(), kind), b(Mbpo(), kind), c(Mbpo(), kind, 4), resumed(Mbpo(), kind, 99);
    for (Scene* scene : {&a, &b, &c}) {
      scene->imagination.Begin(0);
      scene->imagination.Fill(0);
    }
    EXPECT_TRUE(at::equal(a.minibatch.features, b.minibatch.features));
    EXPECT_TRUE(at::equal(a.minibatch.actions, b.minibatch.actions));
    EXPECT_FALSE(at::equal(a.minibatch.actions, c.minibatch.actions));
    nn::TensorFile file;
    a.imagination.SaveState(file.tensors);
    resumed.imagination.LoadState(file);
    for (Scene* scene : {&a, &resumed}) {
      scene->minibatch.input.fill_(3.0);
      scene->minibatch.next_features.fill_(3.0);
      scene->imagination.Begin(1);
      scene->imagination.Fill(1);
    }
    EXPECT_TRUE(at::equal(a.minibatch.next_features, resumed.minibatch.next_features))
        << base::EnumName(kind);
    const ImaginationConfig config = Mbpo();
    EXPECT_EQ(resumed.imagination.num_transitions(),
              config.rollouts * (RolloutSteps(config, 0) + RolloutSteps(config, 1)));
  }
}

TEST(Imagination, WaitsForTheModel) {
  ImaginationConfig config = Dyna();
  config.learning_starts = 8;
  Scene scene(config);
  EXPECT_FALSE(scene.imagination.ready());
  scene.trainer.Update();
  EXPECT_FALSE(scene.imagination.ready());
  scene.trainer.Update();
  EXPECT_TRUE(scene.imagination.ready());
}

TEST(Imagination, RolloutsGrowByTheSchedule) {
  ImaginationConfig config{.rollout_steps = 1};
  EXPECT_EQ(RolloutSteps(config, 1000000), 1);
  config.final_rollout_steps = 5;
  config.schedule_begin = 100;
  config.schedule_end = 500;
  for (const auto& [updates, steps] :
       {std::pair(0, 1), std::pair(100, 1), std::pair(199, 1), std::pair(200, 2), std::pair(499, 4),
        std::pair(500, 5), std::pair(9999, 5)}) {
    EXPECT_EQ(RolloutSteps(config, updates), steps) << updates;
  }
}

TEST(Imagination, StartsFromAStateForEachRollout) {
  EXPECT_EQ(NumStartingStates(Dyna(), kBatch), 3 * kBatch);
  EXPECT_EQ(NumStartingStates(Mbpo(), kBatch), 4 * kBatch);
}

TEST(ImaginedTransitions, OverwritesTheOldest) {
  Minibatch minibatch(kBatch, 1, kFrame, at::kCPU);
  ImaginedTransitions ring(20, 1, minibatch);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < kBatch; ++j) minibatch.reward[j] = i * kBatch + j;
    ring.Add(minibatch);
  }
  EXPECT_EQ(ring.size(), 20);
  base::Random random(1);
  std::vector<int> count(32);
  for (int i = 0; i < 500; ++i) {
    ring.Sample(0, random, minibatch);
    for (int j = 0; j < kBatch; ++j) ++count[static_cast<int>(minibatch.reward[j].item<float>())];
  }
  // 4,000 draws of the last twenty: 200 each, deviation 14; four of them. A 12th would have none.
  for (int i = 0; i < 12; ++i) EXPECT_EQ(count[i], 0) << i;
  for (int i = 12; i < 32; ++i) EXPECT_NEAR(count[i], 200, 56) << i;
}

}  // namespace
}  // namespace slalom::learner
