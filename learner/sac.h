#pragma once

#include "learner/actor_critic.h"
#include "learner/gaussian_actor.h"
#include "learner/noise.h"

namespace slalom::learner {

/// Soft Actor-Critic with automatic temperature (Haarnoja et al. 2018, "Soft Actor-Critic
/// Algorithms and Applications", algorithm 1), with n-step returns and a weight-averaged actor as
/// options. Only the entropy at the end of an n-step window is rewarded, not the entropy of the
/// steps inside it.
class Sac : public ActorCritic<GaussianActor> {
 public:
  explicit Sac(const AlgorithmContext& context) : Sac(context, /*num_critics=*/2, 1) {}

  void Update(double rate) override;
  void Describe(LearnerStats& stats) const override;

  void SaveState(nn::TensorMap& tensors) const override;
  void LoadState(const nn::TensorFile& file) override;

 protected:
  /// For derived methods with other critics.
  Sac(const AlgorithmContext& context, int num_critics, int critic_outputs);

  /// Equation 18, in log alpha: log alpha <- argmin -log alpha mean (log pi(a|s) + target entropy).
  /// log_probability: [B].
  void UpdateTemperature(const at::Tensor& log_probability);

  base::Random random_;       // For actions in the states.
  base::Random next_random_;  // For actions in the next states.
  Noise noise_;
  Noise next_noise_;
  at::Tensor log_temperature_;  // [1], log alpha

 private:
  at::Tensor log_temperature_gradient_;  // [1]
  Adam temperature_adam_;
  at::Tensor temperature_norm_;  // [1] float64, written by Adam, never read.
};

}  // namespace slalom::learner
