#include "learner/model_trainer.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "tests/learner/linear_world.h"
#include "tests/support/allocation_count.h"

namespace slalom::learner {
namespace {

using nn::ModelKind;
using nn::TransitionModelConfig;

constexpr int kBeams = LinearWorld::kBeams;
constexpr int kFrame = kBeams + env::kStateSize;

TransitionModelConfig Small(ModelKind kind, int ensemble = 1) {
  return {.kind = kind, .ensemble = ensemble, .encoder_layers = {}, .head_layers = {32, 32}};
}

ModelTrainingConfig Training() {
  ModelTrainingConfig config;
  config.learning_rate = 2e-3;
  config.batch_size = 64;
  config.updates_per_update = 2;
  return config;
}

ModelTrainer MakeTrainer(const TransitionModelConfig& model, const ModelTrainingConfig& training,
                         std::uint64_t seed = 1) {
  env::ObservationSpec observation;
  observation.num_beams = kBeams;
  const nn::NetworkConfig network;
  const nn::FeatureMap features(observation, network);
  return {training, MakeModelShape(model, network, features.frame_size()),
          features, 1.0,
          false,    at::kCPU,
          seed};
}

void Train(ModelTrainer& trainer, int begin, int end) {
  for (int i = begin; i < end; ++i) {
    RandomRows rows(trainer.sample_spec().batch, 1, kBeams, 100 + i);
    LinearWorld::Fill(i, static_cast<std::int64_t>(i) * 128, rows);
    trainer.Load(rows.rows);
    trainer.Update();
  }
}

nn::TensorFile Saved(const ModelTrainer& trainer) {
  nn::TensorFile file;
  file.source = "memory";
  trainer.SaveState(file.tensors);
  return file;
}

/// Predicts what a batch of the world, that was not trained on, is followed by.
struct Prediction {
  explicit Prediction(const ModelTrainer& trainer)
      : rows(500, 1, kBeams, 7), batch(500, 1, kFrame, at::kCPU) {
    LinearWorld::Fill(8, 0, rows);
    env::ObservationSpec observation;
    observation.num_beams = kBeams;
    MinibatchReader reader(nn::FeatureMap(observation, {}), 1, 1.0, false, 1.0);
    base::Random unused(1);
    reader.Read(rows.rows, unused, batch);
    batch.room.copy_(batch.actions);
    nn::ModelPass pass(trainer.model().shape(), batch.input);
    next = at::zeros({500, kFrame});
    trainer.model().Predict(pass, 0, {}, next);
    reward = pass.reward().clone();
    termination = pass.termination().clone();
    if (trainer.model().shape().probabilistic) log_std = pass.log_std().clone();
  }

  /// Root of the mean squared difference between column `j` and the mean of the true transition.
  double ErrorOf(int column) const {
    double squares = 0.0;
    for (int i = 0; i < 500; ++i) {
      const double action_x = batch.actions[i][0].item<double>();
      const double action_y = batch.actions[i][1].item<double>();
      const double now = batch.features[i][column].item<double>();
      const double truth = column == kBeams       ? 0.9 * now + 0.3 * action_x
                           : column == kBeams + 1 ? now - 0.2 * action_y
                                                  : now;
      const double error = next[i][column].item<double>() - truth;
      squares += error * error;
    }
    return std::sqrt(squares / 500);
  }

  RandomRows rows;
  Minibatch batch;
  at::Tensor next, reward, termination, log_std;
};

TEST(ModelTrainer, LearnsALinearWorld) {
  for (const ModelKind kind : {ModelKind::kDeterministic, ModelKind::kProbabilistic}) {
    ModelTrainer trainer = MakeTrainer(Small(kind), Training());
    Train(trainer, 0, 1500);
    trainer.ReadStats();
    Train(trainer, 1500, 2000);
    const Prediction predicted(trainer);
    // A linear fit to 1e5 transitions would be off by 0.1 * sqrt(3 / 1e5) = 5e-4; what is left is
    // the last few hundred steps of Adam, which chase the noise of the batch.
    EXPECT_LT(predicted.ErrorOf(0), 0.03) << base::EnumName(kind);
    EXPECT_LT(predicted.ErrorOf(kBeams), 0.05) << base::EnumName(kind);
    EXPECT_LT(predicted.ErrorOf(kBeams + 1), 0.03) << base::EnumName(kind);
    EXPECT_LT((predicted.reward - predicted.batch.reward).square().mean().item<double>(), 0.01);
    const at::Tensor ended = predicted.batch.discount == 0;
    const double correct =
        ((predicted.termination > 0.5) == ended).to(at::kDouble).mean().item<double>();
    EXPECT_GT(correct, 0.97) << base::EnumName(kind);

    const ModelStats stats = trainer.ReadStats();
    EXPECT_EQ(stats.num_updates, 1000);
    // Of the six numbers predicted only x and y have noise: (0.1^2 + 0.02^2) / 6 = 0.0017, and
    // 0.041 is its root.
    EXPECT_NEAR(stats.error, 0.041, 0.01) << base::EnumName(kind);
    EXPECT_GT(stats.change, 2 * stats.error) << "nothing to learn";
    EXPECT_LT(stats.termination_nats, 0.1);
    if (kind == ModelKind::kDeterministic) continue;
    EXPECT_NEAR(std::exp(predicted.log_std.select(1, kBeams).mean().item<double>()),
                LinearWorld::kNoiseX, 0.02);
    EXPECT_NEAR(std::exp(predicted.log_std.select(1, kBeams + 1).mean().item<double>()),
                LinearWorld::kNoiseY, 0.008);
    // The four ranges, which are predicted far better than the least standard deviation, are always
    // inside; of x and y half, and 9 of 10.
    EXPECT_NEAR(stats.inside_50, (4.0 + 2 * 0.5) / 6.0, 0.03);
    EXPECT_NEAR(stats.inside_90, (4.0 + 2 * 0.9) / 6.0, 0.02);
    EXPECT_LT(stats.likelihood_nats, 0.0);
  }
}

TEST(ModelTrainer, IsAFunctionOfItsSeed) {
  ModelTrainer a = MakeTrainer(Small(ModelKind::kProbabilistic, 2), Training(), 5);
  ModelTrainer b = MakeTrainer(Small(ModelKind::kProbabilistic, 2), Training(), 5);
  ModelTrainer c = MakeTrainer(Small(ModelKind::kProbabilistic, 2), Training(), 6);
  for (ModelTrainer* trainer : {&a, &b, &c}) Train(*trainer, 0, 5);
  EXPECT_EQ(Saved(a).tensors, Saved(b).tensors);
  EXPECT_NE(a.EliteParameters(), c.EliteParameters());
}

TEST(ModelTrainer, GoesOnBitForBitAfterARestore) {
  ModelTrainingConfig training = Training();
  training.elites = 1;
  training.weight_decay = 0.1;
  training.batch_size = 16;
  ModelTrainer whole = MakeTrainer(Small(ModelKind::kDeterministic, 2), training, 5);
  Train(whole, 0, 255);
  ASSERT_EQ(whole.elites().size(), 1u);
  whole.ReadStats();
  Train(whole, 255, 260);
  ModelTrainer resumed = MakeTrainer(Small(ModelKind::kDeterministic, 2), training, 99);
  resumed.LoadState(Saved(whole));
  EXPECT_EQ(resumed.elites()[0], whole.elites()[0]);
  EXPECT_EQ(Saved(resumed).tensors, Saved(whole).tensors);
  const ModelStats stats = whole.ReadStats();
  EXPECT_EQ(resumed.ReadStats().error, stats.error);
  EXPECT_EQ(stats.num_updates, 10);
}

TEST(ModelTrainer, HeldOutTransitionsTeachNothing) {
  ModelTrainingConfig training = Training();
  training.held_out = 0.5;
  ModelTrainer plain = MakeTrainer(Small(ModelKind::kProbabilistic, 4), training);
  const int batch = plain.sample_spec().batch;
  RandomRows rows(batch, 1, kBeams, 3);
  LinearWorld::Fill(3, 0, rows);
  plain.Load(rows.rows);
  plain.Update();
  const std::vector<float> expected = plain.EliteParameters();
  const auto update = [&] {
    ModelTrainer trainer = MakeTrainer(Small(ModelKind::kProbabilistic, 4), training);
    trainer.Load(rows.rows);
    trainer.Update();
    return trainer.EliteParameters();
  };
  std::vector<int> held_out;
  for (int i = 0; i < batch; ++i) {
    const float reward = rows.rows.n_step_return[i];
    rows.rows.n_step_return[i] += 10.0f;
    if (update() == expected) held_out.push_back(i);
    rows.rows.n_step_return[i] = reward;
  }
  // Of 128 a half, and of the rest the 1 / e^4 that no member has in its sample: 0.51, mean 65,
  // deviation 5.7; four of them. If each member held out a half of its own, 0.22 would teach none
  // of them: 28.
  EXPECT_NEAR(std::ssize(held_out), 65, 23);
  for (const int i : held_out) rows.rows.n_step_return[i] = 1000.0f;
  EXPECT_EQ(update(), expected);
}

TEST(ModelTrainer, ElitesAreThoseThatPredictBest) {
  ModelTrainingConfig training = Training();
  training.elites = 2;
  training.learning_rate = 1e-5;  // So that the one that is spoilt stays so.
  training.batch_size = 16;
  training.held_out = 0.2;
  ModelTrainer trainer = MakeTrainer(Small(ModelKind::kDeterministic, 3), training);
  std::vector<float> parameters(Saved(trainer).tensors.at("model.parameters").bytes.size() / 4);
  const std::size_t size = parameters.size() / 3;
  const auto scale = [&](std::size_t member, float factor) {
    nn::TensorFile state = Saved(trainer);
    state.Read("model.parameters", std::span(parameters));
    for (std::size_t i = 0; i < size; ++i) parameters[member * size + i] *= factor;
    state.tensors["model.parameters"] = nn::StoredTensor::Of(std::span<const float>(parameters));
    trainer.LoadState(state);
  };
  scale(1, 10.0f);
  EXPECT_NE(parameters[0], parameters[2 * size]) << "members begin alike";
  EXPECT_THAT(trainer.elites(), testing::ElementsAre(0, 1));
  Train(trainer, 0, 250);
  EXPECT_THAT(trainer.elites(), testing::UnorderedElementsAre(0, 2));
  EXPECT_EQ(trainer.EliteParameters().size(), 2 * size);
  // What a member predicted before the last choice is forgotten, however bad it was.
  scale(1, 0.1f);
  scale(0, 4.0f);
  Train(trainer, 250, 500);
  EXPECT_THAT(trainer.elites(), testing::UnorderedElementsAre(1, 2));
}

TEST(ModelTrainer, AllocatesNothing) {
  at::set_num_threads(1);
  ModelTrainer trainer = MakeTrainer(Small(ModelKind::kProbabilistic, 2), Training());
  Train(trainer, 0, 1);
  RandomRows rows(trainer.sample_spec().batch, 1, kBeams, 3);
  LinearWorld::Fill(3, 0, rows);
  const long before = test::NumAllocations();
  trainer.Load(rows.rows);
  trainer.Update();
  EXPECT_EQ(test::NumAllocations() - before, 0);
}

TEST(ModelTrainer, NotesWeightsThatAreNotFinite) {
  ModelTrainer trainer = MakeTrainer(Small(ModelKind::kDeterministic), Training());
  RandomRows rows(trainer.sample_spec().batch, 1, kBeams, 3);
  LinearWorld::Fill(3, 0, rows);
  for (int i = 0; i < rows.rows.batch; ++i) {
    rows.rows.n_step_return[i] = std::numeric_limits<float>::quiet_NaN();
  }
  EXPECT_TRUE(trainer.is_finite());
  trainer.Load(rows.rows);
  trainer.Update();
  EXPECT_FALSE(trainer.is_finite());
}

TEST(ModelTrainer, RefusesTheStateOfAnotherEnsemble) {
  nn::TensorFile other = Saved(MakeTrainer(Small(ModelKind::kDeterministic, 3), Training()));
  EXPECT_THROW(MakeTrainer(Small(ModelKind::kDeterministic, 2), Training()).LoadState(other),
               base::Error);
}

}  // namespace
}  // namespace slalom::learner
