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

void NetworkAgent::Act(const env::ObservationBatch& observations, std::span<float> actions) {
  nn::InferenceNetwork& inference = network_->inference;
  const int batch = observations.batch_size;
  const env::StepShape shape = snapshot_.spec.step_shape();
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(batch) * shape.action_size);
  SLALOM_CHECK_EQ(observations.num_beams, shape.num_beams);
  // Privileged fields, which only a teacher sees, come last.
  const int besides = observations.state_size - shape.state_size;
  SLALOM_CHECK(besides == 0 || besides == env::kPrivilegedSize);
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
  // Means come first; a gaussian's other outputs matter to `Explore` only.
  const float* row = inference.output().data();
  const int outputs = snapshot_.spec.distribution.num_outputs(shape.action_size);
  for (float* action = actions.data(); action != actions.data() + actions.size();
       action += shape.action_size, row += outputs) {
    for (int j = 0; j < shape.action_size; ++j) action[j] = std::tanh(row[j]);
  }
}

bool NetworkAgent::Explore(std::span<const float> noise, std::span<float> actions) {
  const ActionDistribution& distribution = snapshot_.spec.distribution;
  if (distribution.is_deterministic()) return false;
  const auto size = static_cast<std::size_t>(snapshot_.spec.action_size);
  const float* row = network_->inference.output().data();
  for (std::size_t i = 0; i < actions.size(); i += size, row += 2 * size) {
    for (std::size_t j = 0; j < size; ++j) {
      const float deviation = std::exp(distribution.log_std(row[size + j]));
      actions[i + j] = std::tanh(row[j] + deviation * noise[i + j]);
    }
  }
  return true;
}

}  // namespace slalom::policy
