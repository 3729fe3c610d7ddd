#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.h"
#include "learner/algorithm.h"
#include "learner/learner.h"
#include "policy/policy_agent.h"
#include "tests/learner/random_rows.h"

namespace slalom::learner {
namespace {

constexpr int kBeams = 12;

MethodConfig ModelMethod(ImaginationKind imagination) {
  MethodConfig method;
  method.learner.device = DeviceChoice::kCpu;
  method.learner.batch_size = 8;
  method.learner.mirror = true;
  method.model.kind = nn::ModelKind::kProbabilistic;
  method.model.ensemble = 3;
  method.model.encoder_layers = {};
  method.model.head_layers = {16};
  method.model_training.batch_size = 8;
  method.model_training.updates_per_update = 2;
  method.model_training.elites = 2;
  method.imagination.kind = imagination;
  method.imagination.imagined_batches = 3;
  method.imagination.rollout_steps = 2;
  method.imagination.learning_starts = 4;
  method.imagination.rollouts = 16;
  method.imagination.buffer_capacity = 40;
  return method;
}

policy::PolicySpec SpecOf(const MethodConfig& method) {
  policy::PolicySpec spec;
  spec.observation.num_beams = kBeams;
  spec.network.encoder_layers = {};
  spec.network.head_layers = {16};
  spec.network.history = 2;
  spec.planning = PlanningOf(method);
  return spec;
}

void Train(Learner& learner, int begin, int end) {
  for (int i = begin; i < end; ++i) {
    const RandomBatches drawn(learner.sample_specs(), kBeams, 100 + i, 1000 * i);
    learner.Update(drawn.batches, 0.0);
  }
}

nn::TensorFile Saved(const Learner& learner) {
  nn::TensorFile file;
  file.source = "memory";
  learner.SaveState(file.tensors);
  return file;
}

TEST(ModelBasedLearner, AsksForTheModelsTransitions) {
  const MethodConfig method = ModelMethod(ImaginationKind::kDyna);
  const auto specs = SampleSpecs(method, SpecOf(method));
  ASSERT_EQ(specs.size(), 2u);
  // Three imagined batches begin at 24 states, more than the two batches of 8 for the model.
  EXPECT_EQ(specs[1].batch, 24);
  EXPECT_EQ(specs[1].n_step, 1);
  EXPECT_EQ(specs[1].history, 2);
}

TEST(ModelBasedLearner, ImaginesOnceTheModelKnowsEnough) {
  // Two updates of the model each time: from the second on there are four.
  for (const auto& [kind, updates] :
       {std::pair(ImaginationKind::kNone, 4), std::pair(ImaginationKind::kDyna, 1 + 3 * 4),
        std::pair(ImaginationKind::kMbpo, 1 + 3 * 3)}) {
    const MethodConfig method = ModelMethod(kind);
    Learner learner(method, SpecOf(method), 5);
    Train(learner, 0, 4);
    EXPECT_EQ(learner.num_updates(), updates) << base::EnumName(kind);
    EXPECT_TRUE(learner.healthy());
    EXPECT_EQ(learner.ReadStats().model.num_updates, 8);
  }
}

TEST(ModelBasedLearner, GoesOnBitForBitAfterARestore) {
  using enum ImaginationKind;
  for (const ImaginationKind kind : {kNone, kDyna, kMbpo}) {
    const MethodConfig method = ModelMethod(kind);
    Learner whole(method, SpecOf(method), 5);
    Train(whole, 0, 5);
    Learner resumed(method, SpecOf(method), 99);
    resumed.LoadState(Saved(whole));
    Train(whole, 5, 9);
    Train(resumed, 5, 9);
    EXPECT_TRUE(Saved(whole).tensors == Saved(resumed).tensors) << base::EnumName(kind);
    EXPECT_TRUE(*whole.Snapshot().model_weights == *resumed.Snapshot().model_weights)
        << base::EnumName(kind);
  }
}

TEST(ModelBasedLearner, ItsPoliciesCanPlan) {
  const MethodConfig method = ModelMethod(ImaginationKind::kNone);
  Learner learner(method, SpecOf(method), 5);
  const policy::PolicySnapshot snapshot = learner.Snapshot();
  EXPECT_EQ(snapshot.spec.planning.model.ensemble, 2);
  const auto agent =
      policy::MakePolicyAgent(snapshot, {.enabled = true, .samples = 8, .learning_starts = 0}, 1);
  env::ObservationBatch observations;
  observations.Resize(2, kBeams);
  std::vector<env::Action> actions(2);
  agent->Act(observations, env::NumbersOf(actions));
  EXPECT_EQ(actions[0], actions[1]);
}

/// Any algorithm on any encoder, with a model on the same encoder.
class CombinationTest
    : public testing::TestWithParam<std::tuple<const char*, nn::EncoderFamily, ImaginationKind>> {};

TEST_P(CombinationTest, ImaginesPlansAndGoesOnBitForBitAfterARestore) {
  const auto& [algorithm, encoder, imagination] = GetParam();
  MethodConfig method = ModelMethod(imagination);
  method.learner.algorithm = algorithm;
  const std::vector<int> layers =
      encoder == nn::EncoderFamily::kMlp ? std::vector<int>{} : std::vector<int>{8, 8};
  method.model.encoder_layers = layers;
  policy::PolicySpec spec = SpecOf(method);
  spec.network.encoder = encoder;
  spec.network.encoder_layers = layers;
  spec.network.attention_heads = 2;
  spec.distribution = DistributionOf(method.learner);
  Learner whole(method, spec, 5);
  const nn::TensorMap begin = Saved(whole).tensors;
  Train(whole, 0, 4);
  ASSERT_TRUE(whole.healthy()) << *whole.FindFault();
  EXPECT_GT(whole.num_updates(), 4) << "nothing was imagined";
  const nn::TensorMap trained = Saved(whole).tensors;
  for (const char* name : {"actor.parameters", "critics.parameters"}) {
    EXPECT_NE(trained.at(name), begin.at(name)) << name;
  }

  const auto agent = policy::MakePolicyAgent(
      whole.Snapshot(), {.enabled = true, .samples = 8, .learning_starts = 0}, 1);
  env::ObservationBatch observations;
  observations.Resize(1, kBeams);
  std::vector<env::Action> actions(1);
  agent->Act(observations, env::NumbersOf(actions));
  EXPECT_LE(std::abs(actions[0].linear), 1.0f);
  EXPECT_LE(std::abs(actions[0].angular), 1.0f);

  Learner resumed(method, spec, 99);
  resumed.LoadState(Saved(whole));
  Train(whole, 4, 6);
  Train(resumed, 4, 6);
  EXPECT_TRUE(Saved(whole).tensors == Saved(resumed).tensors);
}

INSTANTIATE_TEST_SUITE_P(
    Any, CombinationTest,
    testing::Combine(testing::Values("td3", "ddpg", "sac"),
                     testing::Values(nn::EncoderFamily::kMlp, nn::EncoderFamily::kCnn,
                                     nn::EncoderFamily::kGru, nn::EncoderFamily::kTransformer),
                     testing::Values(ImaginationKind::kDyna, ImaginationKind::kMbpo)),
    [](const auto& test) {
      return fmt::format("{}_{}_{}", std::get<0>(test.param),
                         base::EnumName(std::get<1>(test.param)),
                         base::EnumName(std::get<2>(test.param)));
    });

}  // namespace
}  // namespace slalom::learner
