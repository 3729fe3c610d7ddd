#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/critics.h"
#include "learner/learner_config.h"
#include "learner/learner_stats.h"
#include "learner/minibatch.h"
#include "policy/nn/safetensors.h"

/// Shapes: `B` batch, `A` numbers of an action.

namespace slalom::learner {

/// A Lagrangian constraint on the cost of episodes, for any algorithm:
///
///   max_pi J(pi) subject to J_C(pi) <= d,
///   L(pi, lambda) = J(pi) - lambda (J_C(pi) - d),  lambda >= 0
///
/// (the paper's section on safe RL). The policy maximises Q(s, a) - lambda Q_C(s, a), where twin
/// cost critics learn the discounted cost Q_C. The multiplier lambda is updated from finished
/// episodes: J_C is the mean sum of their costs (on courses, their collisions), so neither
/// discounting nor function approximation distorts it. With a proportional or derivative gain, the
/// update is the PID controller of Stooke, Achiam and Abbeel (2020), algorithm 2.
/// Thread-compatible.
class Constraint {
 public:
  static constexpr int kNumCritics = 2;

  /// Requires: config.kind is not "none". Keeps references to `minibatch` and `totals`, which must
  /// outlive the constraint.
  Constraint(const ConstraintConfig& config, const nn::NetworkShape& critic_shape,
             base::Random& initial_weights, Minibatch& minibatch, Totals& totals);

  /// Takes one gradient step of the cost critics towards c + gamma^n max_k Q'_C,k(s', a') on the
  /// minibatch. The maximum guards against underestimated costs (the original takes the minimum of
  /// negative costs). next_action: a', [B, A].
  void UpdateCritics(const at::Tensor& next_action, double learning_rate, double polyak_rate);

  /// Adds lambda mean_i grad_a Q_C,1(s_i, a_i) to the gradient [B, A] of the actor's loss. state:
  /// the minibatch's; action: [B, A].
  void AddActionGradient(const at::Tensor& state, const at::Tensor& action,
                         at::Tensor& action_gradient);

  /// Returns lambda mean_i Q_C,1(s_i, a_i), a term for actors' losses that autograd differentiates.
  at::Tensor Penalty(const at::Tensor& state, const at::Tensor& action) const;

  /// Updates lambda from recent training episodes: `mean_cost` is the mean sum of their costs (NaN
  /// if unknown), `finished` the number that ended since the last call. Without finished episodes,
  /// lambda stays.
  void Observe(double mean_cost, std::int64_t finished);

  double multiplier() const { return multiplier_; }
  void Describe(LearnerStats& stats) const;
  const at::Tensor& critic_parameters() const { return critics_.parameters(); }

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  const ConstraintConfig config_;
  Minibatch& minibatch_;
  Totals& totals_;
  Critics critics_;
  at::Tensor target_;     // [B], y
  at::Tensor td_errors_;  // [B]
  double integral_;
  double multiplier_;
  double mean_cost_ = LearnerStats::kNone;  // At the last `Observe`.
  std::int64_t num_episodes_ = 0;           // Finished episodes observed so far.
};

}  // namespace slalom::learner
