#pragma once

#include "learner/actor_critic.h"
#include "learner/gaussian_actor.h"
#include "learner/noise.h"

namespace slalom::learner {

/// Soft Actor-Critic with automatic temperature (Haarnoja et al. 2018, "Soft Actor-Critic
/// Algorithms and Applications", algorithm 1), with n-step returns and a weight-averaged actor as
/// options. The entropy of steps inside an n-step window is not rewarded, only that at its end.
class Sac : public ActorCritic<GaussianActor> {
 public:
  explicit Sac(const AlgorithmContext& context);

  void Update(double rate) override;
  void Describe(LearnerStats& stats) const override;

  void SaveState(policy::TensorMap& tensors) const override;
  void LoadState(const policy::TensorFile& file) override;

 private:
  base::Random random_;       // Of the policy in the states.
  base::Random next_random_;  // Of the policy in the next states.
  Noise noise_;
  Noise next_noise_;
  at::Tensor log_temperature_;           // [1], log alpha
  at::Tensor log_temperature_gradient_;  // [1]
  Adam temperature_adam_;
  at::Tensor temperature_norm_;  // [1] float64, unused but asked for by Adam.
};

}  // namespace slalom::learner
