#include "learner/prediction_error.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include <cmath>

#include "learner/model_trainer.h"
#include "tests/learner/random_rows.h"

namespace slalom::learner {
namespace {

constexpr int kBeams = 4;
constexpr int kFrame = kBeams + env::kStateSize;
constexpr int kSteps = 3;

// A model that says that nothing changes, on frames of which every number grows by a known amount
// from one to the next: after k steps it is off by k times that.
TEST(PredictionErrors, GrowsWithTheStepsAheadAndPassesPaddingOver) {
  for (const int history : {1, 2}) {
    env::ObservationSpec observation;
    observation.num_beams = kBeams;
    const nn::NetworkConfig network{.history = history};
    const nn::FeatureMap features(observation, network);
    const nn::TransitionModelConfig config{
        .kind = nn::ModelKind::kDeterministic, .encoder_layers = {}, .head_layers = {}};
    const nn::ModelShape shape = MakeModelShape(config, network, kFrame);
    const nn::TransitionModel model(shape, at::zeros({shape.num_parameters()}));
    RandomRows random_rows(6, history + kSteps, kBeams, 1);
    replay::SampledRows& rows = random_rows.rows;
    for (int i = 0; i < 6; ++i) {
      for (int age = 0; age < history + kSteps; ++age) {
        const std::size_t at = static_cast<std::size_t>(i) * (history + kSteps) + age;
        // 50 cm of 5 m are 0.2 of the features from -1 to 1; the goal's 0.5 m are 0.1.
        for (int j = 0; j < kBeams; ++j) {
          random_rows.scans[at * kBeams + j] = static_cast<std::uint16_t>(100 + 50 * age);
        }
        rows.state[at * 4] = 0.5f * static_cast<float>(age);
        rows.state[at * 4 + 1] = 0.5f * static_cast<float>(age);
      }
    }
    // One sample at the begin of its episode, whose frames say nonsense: the first is a copy of the
    // second, in memory of its own, as rows lie that came over a wire.
    const std::vector<std::uint16_t> copy(rows.ranges_cm[1], rows.ranges_cm[1] + kBeams);
    rows.ranges_cm[0] = copy.data();
    for (int j = 0; j < env::kStateSize; ++j) rows.state[j] = rows.state[4 + j] = 100.0f;
    const std::vector<double> errors = PredictionErrors(model, 0, features, rows, at::kCPU);
    ASSERT_EQ(errors.size(), 3u);
    const double step = std::sqrt((kBeams * 0.2 * 0.2 + 2 * 0.1 * 0.1) / (kBeams + 2));
    for (int k = 0; k < kSteps; ++k) EXPECT_NEAR(errors[k], (k + 1) * step, 1e-5);
  }
}

// The model moves the goal's x by the action: what it is told must be the actions that led there.
TEST(PredictionErrors, RollsForwardByTheActionsTaken) {
  env::ObservationSpec observation;
  observation.num_beams = kBeams;
  const nn::FeatureMap features(observation, {});
  const nn::TransitionModelConfig config{
      .kind = nn::ModelKind::kDeterministic, .encoder_layers = {}, .head_layers = {}};
  const nn::ModelShape shape = MakeModelShape(config, {}, kFrame);
  at::Tensor parameters = at::zeros({shape.num_parameters()});
  parameters[kBeams * (kFrame + 2) + kFrame] = 0.1;  // Row: the goal's x; column: linear action.
  const nn::TransitionModel model(shape, parameters);
  RandomRows random_rows(5, 1 + kSteps, kBeams, 1);
  replay::SampledRows& rows = random_rows.rows;
  for (int i = 0; i < 5; ++i) {
    float x = 0.0f;
    for (int age = 0; age <= kSteps; ++age) {
      const std::size_t at = static_cast<std::size_t>(i) * (1 + kSteps) + age;
      for (int j = 0; j < kBeams; ++j) random_rows.scans[at * kBeams + j] = 100;
      float* const state = &rows.state[at * 4];
      if (age > 0) x += 0.5f * state[2];  // 0.5 m are 0.1 of the feature.
      state[0] = x;
      state[1] = 0.0f;
    }
  }
  for (const double error : PredictionErrors(model, 0, features, rows, at::kCPU)) {
    EXPECT_LT(error, 1e-6);
  }
}

}  // namespace
}  // namespace slalom::learner
