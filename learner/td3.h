#pragma once

#include "learner/actor_critic.h"
#include "learner/deterministic_actor.h"
#include "learner/noise.h"

namespace slalom::learner {

/// Twin Delayed Deep Deterministic policy gradient (Fujimoto, van Hoof and Meger 2018, algorithm
/// 1), with n-step returns and a weight-averaged actor as options.
class Td3 : public ActorCritic<DeterministicActor> {
 public:
  explicit Td3(const AlgorithmContext& context);

  void Update(double rate) override;

  void SaveState(nn::TensorMap& tensors) const override;
  void LoadState(const nn::TensorFile& file) override;

 private:
  base::Random random_;  // For the target noise.
  Noise noise_;
  at::Tensor next_action_;  // [B, A], a'
};

}  // namespace slalom::learner
