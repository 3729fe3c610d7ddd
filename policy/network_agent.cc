#include "policy/network_agent.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/check.h"
#include "base/file.h"
#include "base/random.h"
#include "nn/feature_map.h"
#include "nn/layer_ops.h"
#include "nn/network.h"

namespace slalom::policy {

struct NetworkAgent::Network {
  explicit Network(const PolicySnapshot& snapshot)
      : features(snapshot.spec.observation, snapshot.spec.network),
        shape(snapshot.spec.actor_shape()),
        network(shape, nn::ViewWeights(*snapshot.weights)) {}

  nn::FeatureMap features;
  nn::NetworkShape shape;
  nn::Network network;
  at::Tensor input;         // [B, H * F]
  base::Random dropout{0};  // Of a policy that drops when acting; seeded by what is seen.
  std::optional<nn::NetworkPass> pass;
};

NetworkAgent::NetworkAgent(PolicySnapshot snapshot)
    : snapshot_(std::move(snapshot)), network_(std::make_unique<Network>(snapshot_)) {}

NetworkAgent::~NetworkAgent() = default;

void NetworkAgent::SetSnapshot(PolicySnapshot snapshot) {
  SLALOM_CHECK(snapshot.spec.network == snapshot_.spec.network);
  SLALOM_CHECK(snapshot.spec.observation == snapshot_.spec.observation);
  SLALOM_CHECK(snapshot.spec.distribution == snapshot_.spec.distribution);
  network_->network = nn::Network(network_->shape, nn::ViewWeights(*snapshot.weights));
  snapshot_ = std::move(snapshot);
}

void NetworkAgent::Act(const env::ObservationBatch& observations, std::span<env::Action> actions) {
  Network& net = *network_;
  const int batch = observations.batch_size;
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(batch));
  SLALOM_CHECK_EQ(observations.num_beams, net.features.num_beams());
  if (batch == 0) return;
  if (!net.pass || net.input.size(0) != batch) {
    net.input = at::zeros({batch, net.shape.num_inputs()}, at::kFloat);
    net.pass.emplace(net.shape, net.input, nn::PassUse::kInference, &net.dropout);
  }
  float* const input = net.input.data_ptr<float>();
  net.features.PushFrames(observations, net.shape.config.history, input);
  if (net.shape.config.dropout_everywhere) {
    // So that acting has no state but the frames, and a run that is resumed goes on as it would
    // have.
    net.dropout = base::Random(base::Checksum(
        std::as_bytes(std::span(input, static_cast<std::size_t>(net.input.numel())))));
  }
  net.network.Forward(*net.pass);
  const int outputs = snapshot_.spec.distribution.num_outputs();
  if (outputs == 2) nn::Tanh(net.pass->output());
  const float* const output = net.pass->output().data_ptr<float>();
  for (int i = 0; i < batch; ++i) {
    const float* const row = output + static_cast<std::ptrdiff_t>(i) * outputs;
    actions[i] = outputs == 2 ? env::Action{row[0], row[1]}
                              : env::Action{std::tanh(row[0]), std::tanh(row[1])};
  }
}

bool NetworkAgent::Explore(std::span<const env::Action> noise, std::span<env::Action> actions) {
  const ActionDistribution& distribution = snapshot_.spec.distribution;
  if (distribution.is_deterministic()) return false;
  const float* row = network_->pass->output().data_ptr<float>();
  const auto draw = [&distribution](float mean, float raw, float epsilon) {
    return std::tanh(mean + std::exp(distribution.log_std(raw)) * epsilon);
  };
  for (std::size_t i = 0; i < actions.size(); ++i, row += 4) {
    actions[i] = {draw(row[0], row[2], noise[i].linear), draw(row[1], row[3], noise[i].angular)};
  }
  return true;
}

}  // namespace slalom::policy
