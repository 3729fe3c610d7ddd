#pragma once

#include <memory>
#include <span>

#include "env/agent.h"
#include "policy/policy_agent.h"

namespace slalom::policy {

/// Drives with a policy network, on the calling thread and without LibTorch
/// (`nn::InferenceNetwork`). There is no exploration noise; a gaussian policy drives by its mode.
///
/// Keeps each environment's last H frames. At the start of an episode, copies of its first frame
/// take the place of earlier ones. Confined to one thread at a time. Allocates only when the batch
/// size changes.
class NetworkAgent : public PolicyAgent {
 public:
  /// Throws `base::Error` if the policy's sectors do not divide its beams.
  explicit NetworkAgent(PolicySnapshot snapshot);
  ~NetworkAgent() override;

  /// Replaces the weights by others of the same spec; the frames seen so far stay.
  /// Requires: network, distribution and observation spec are those it was made with.
  void SetSnapshot(PolicySnapshot snapshot) override;

  /// Requires: observations and actions of the policy's shape.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

  bool Explore(std::span<const float> noise, std::span<float> actions) override;

  const PolicySnapshot& snapshot() const override { return snapshot_; }

 private:
  struct Network;

  PolicySnapshot snapshot_;
  std::unique_ptr<Network> network_;
};

}  // namespace slalom::policy
