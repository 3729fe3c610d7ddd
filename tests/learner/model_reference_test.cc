#include <gtest/gtest.h>
#include <torch/torch.h>

#include <string>

#include "learner/model_trainer.h"
#include "tests/learner/random_rows.h"
#include "tests/learner/reference_model_loss.h"
#include "tests/learner/reference_network.h"

/// Whole updates of a transition model beside autograd and LibTorch's AdamW in float64.

namespace slalom::learner {
namespace {

using at::Tensor;

constexpr int kBeams = 24;
constexpr std::uint64_t kSeed = 3;

struct Case {
  const char* name;
  nn::TransitionModelConfig model;
  nn::NetworkConfig network = {.history = 2};
  StateLoss state_loss = StateLoss::kMean;
  double weight_decay = 0.0;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class ModelReferenceTest : public testing::TestWithParam<Case> {};

TEST_P(ModelReferenceTest, UpdatesAreThoseOfAdamW) {
  const nn::TransitionModelConfig& model = GetParam().model;
  nn::NetworkConfig network = GetParam().network;
  network.attention_heads = 2;
  network.sectors = 12;
  env::ObservationSpec observation;
  observation.num_beams = kBeams;
  const nn::FeatureMap features(observation, network);
  const nn::ModelShape shape = MakeModelShape(model, network, features.frame_size());
  ModelTrainingConfig training;
  // Small steps, for the reason given in reference_test.cc.
  training.learning_rate = 1e-4;
  training.weight_decay = GetParam().weight_decay;
  training.batch_size = 16;
  training.updates_per_update = 2;
  training.state_loss = GetParam().state_loss;
  training.held_out = 0.0;
  constexpr double kRewardScale = 0.5;
  ModelTrainer trainer(training, shape, features, kRewardScale, /*mirror=*/false, at::kCPU, kSeed);

  const auto read = [&] { return torch::tensor(trainer.EliteParameters()).to(torch::kDouble); };
  Tensor parameters = read().requires_grad_();
  const Tensor initial = parameters.detach().clone();
  torch::optim::AdamW optimiser(
      {parameters},
      torch::optim::AdamWOptions(training.learning_rate).weight_decay(training.weight_decay));
  const double state_scale =
      training.state_loss == StateLoss::kSum ? 1.0 : 1.0 / shape.num_predicted;
  MinibatchReader reader(features, network.history, kRewardScale, false, 1.0);
  base::Random unused(1);
  constexpr int kLoads = 3;
  constexpr int kUpdates = 2 * kLoads;
  for (int load = 0; load < kLoads; ++load) {
    const RandomRows rows(2 * training.batch_size, network.history, kBeams, 50 + load);
    trainer.Load(rows.rows);
    trainer.Update();

    Minibatch batch(rows.rows.batch, network.history, features.frame_size(), at::kCPU);
    reader.Read(rows.rows, unused, batch);
    for (int u = 0; u < 2; ++u) {
      const auto half = [&](const Tensor& t) {
        return t.narrow(0, u * training.batch_size, training.batch_size).to(torch::kDouble);
      };
      const ModelTargets targets = {half(batch.features), half(batch.next_features),
                                    half(batch.reward),   half(batch.discount),
                                    half(batch.cost),     {}};
      const Tensor raw =
          ReferenceForward(shape.network, parameters, targets.features, half(batch.actions));
      optimiser.zero_grad();
      ReferenceLossOf(model, state_scale, raw, targets).loss.mean().backward();
      optimiser.step();
    }
  }
  const Tensor expected = parameters.detach();
  EXPECT_GT((expected - initial).abs().mean().item<double>(), 1e-4) << "nothing was learned";
  const Tensor difference = (read() - expected).abs();
  // As in reference_test.cc.
  EXPECT_LE(difference.mean().item<double>(), 5e-8);
  EXPECT_LE(difference.max().item<double>(), kUpdates * 2e-4);
}

nn::TransitionModelConfig Small(nn::ModelKind kind,
                                nn::ModelTargets targets = nn::ModelTargets::kDifference) {
  return {.kind = kind, .targets = targets, .encoder_layers = {16}, .head_layers = {16, 16}};
}

nn::TransitionModelConfig AsPublished(nn::ModelKind kind) {
  nn::TransitionModelConfig model = Small(kind, nn::ModelTargets::kAbsolute);
  model.log_std = nn::LogStdBounds::kPublished;
  model.bound_ranges = true;
  model.predict_last_action = true;
  return model;
}

nn::TransitionModelConfig WithLayerNorm(nn::ModelKind kind) {
  nn::TransitionModelConfig model = Small(kind);
  model.encoder_layers = {};
  model.layer_norm = true;
  return model;
}

/// For every encoder alike.
nn::TransitionModelConfig OnEncoder(nn::ModelKind kind) {
  nn::TransitionModelConfig model = Small(kind);
  model.encoder_layers = {16, 16};
  return model;
}

using enum nn::ModelKind;
using enum nn::EncoderFamily;

const Case kCases[] = {
    {"Deterministic", Small(kDeterministic)},
    {"DeterministicSum", Small(kDeterministic), {}, StateLoss::kSum},
    {"DeterministicDecayed", Small(kDeterministic), {}, StateLoss::kMean, 1.0},
    {"DeterministicAsPublished", AsPublished(kDeterministic)},
    {"DeterministicLayerNorm", WithLayerNorm(kDeterministic)},
    {"Probabilistic", Small(kProbabilistic)},
    {"ProbabilisticDecayed", Small(kProbabilistic), {}, StateLoss::kSum, 1.0},
    {"ProbabilisticAsPublished", AsPublished(kProbabilistic), {}, StateLoss::kSum},
    {"ProbabilisticLayerNorm", WithLayerNorm(kProbabilistic)},
    {"Cnn", OnEncoder(kProbabilistic), {.encoder = kCnn, .history = 4}},
    {"Gru", OnEncoder(kProbabilistic), {.encoder = kGru, .history = 4}},
    {"Transformer", OnEncoder(kProbabilistic), {.encoder = kTransformer, .history = 4}},
};

INSTANTIATE_TEST_SUITE_P(Models, ModelReferenceTest, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace slalom::learner
