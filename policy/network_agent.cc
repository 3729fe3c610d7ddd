#include "policy/network_agent.h"

#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/file.h"
#include "base/random.h"
#include "policy/nn/feature_map.h"
#include "policy/nn/inference/inference_network.h"

namespace slalom::policy {

struct NetworkAgent::Network {
  explicit Network(const PolicySpec& spec)
      : features(spec.observation, spec.network), inference(spec.actor_shape()) {}

  nn::FeatureMap features;
  nn::InferenceNetwork inference;
  base::Random dropout{0};  // For policies that drop units when acting; seeded by the input.
};

NetworkAgent::NetworkAgent(PolicySnapshot snapshot)
    : snapshot_(std::move(snapshot)), network_(std::make_unique<Network>(snapshot_.spec)) {
  network_->inference.SetWeights(*snapshot_.weights);
}

NetworkAgent::~NetworkAgent() = default;

void NetworkAgent::SetSnapshot(PolicySnapshot snapshot) {
  SLALOM_CHECK(snapshot.spec.network == snapshot_.spec.network);
  SLALOM_CHECK(snapshot.spec.observation == snapshot_.spec.observation);
  SLALOM_CHECK(snapshot.spec.distribution == snapshot_.spec.distribution);
  network_->inference.SetWeights(*snapshot.weights);
  snapshot_ = std::move(snapshot);
}

void NetworkAgent::Act(const env::ObservationBatch& observations, std::span<env::Action> actions) {
  nn::InferenceNetwork& inference = network_->inference;
  const int batch = observations.batch_size;
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(batch));
  SLALOM_CHECK_EQ(observations.num_beams, network_->features.num_beams());
  if (batch == 0) return;
  if (inference.batch() != batch) inference.Resize(batch);
  const std::span<float> input = inference.input();
  network_->features.PushFrames(observations, snapshot_.spec.network.history, input.data());
  if (snapshot_.spec.network.dropout_everywhere) {
    // So that acting has no state but the frames, and a run that is resumed goes on as it would
    // have.
    network_->dropout = base::Random(base::Checksum(std::as_bytes(input)));
  }
  inference.Forward(&network_->dropout);
  // Means come first; a gaussian's two other outputs matter to `Explore` only.
  const float* row = inference.output().data();
  const int outputs = snapshot_.spec.distribution.num_outputs();
  for (env::Action& action : actions) {
    action = {std::tanh(row[0]), std::tanh(row[1])};
    row += outputs;
  }
}

bool NetworkAgent::Explore(std::span<const env::Action> noise, std::span<env::Action> actions) {
  const ActionDistribution& distribution = snapshot_.spec.distribution;
  if (distribution.is_deterministic()) return false;
  const float* row = network_->inference.output().data();
  const auto draw = [&distribution](float mean, float raw, float epsilon) {
    return std::tanh(mean + std::exp(distribution.log_std(raw)) * epsilon);
  };
  for (std::size_t i = 0; i < actions.size(); ++i, row += 4) {
    actions[i] = {draw(row[0], row[2], noise[i].linear), draw(row[1], row[3], noise[i].angular)};
  }
  return true;
}

}  // namespace slalom::policy
