#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/critics.h"
#include "learner/learner_config.h"
#include "learner/learner_stats.h"
#include "learner/minibatch.h"
#include "policy/safetensors.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action.

namespace slalom::learner {

/// A Lagrangian constraint on collisions, for any algorithm:
///
///   max_pi J(pi) subject to J_C(pi) <= d,
///   L(pi, lambda) = J(pi) - lambda (J_C(pi) - d),  lambda >= 0
///
/// (Xu et al., sections II and IV-B). The policy climbs Q(s, a) - lambda Q_C(s, a), with the
/// discounted cost Q_C learned by twin critics of its own. lambda ascends by what finished episodes
/// show: J_C is their mean number of collisions, which no discount or function approximation
/// distorts. With gains beyond the integral one it is the PID controller of algorithm 2 of Stooke,
/// Achiam and Abbeel (2020). Thread-compatible.
class Constraint {
 public:
  static constexpr int kNumCritics = 2;

  /// Requires: config.kind is not "none". The critics read `minibatch`, which outlives this.
  Constraint(const ConstraintConfig& config, const policy::NetworkShape& critic_shape,
             base::Random& initial_weights, Minibatch& minibatch, Totals& totals);

  /// Regresses the cost critics on c + gamma^n max_k Q'_C,k(s', a'), with a' from
  /// minibatch.next_actions: of two estimates, the one that fears more (the original's minimum of
  /// negative costs).
  void UpdateCritics(double learning_rate, double polyak_rate);

  /// Adds lambda mean_i grad_a Q_C,1(s_i, a_i) to the gradient [B, A] of what the actor descends,
  /// with a from minibatch.actions.
  void AddActionGradient(at::Tensor& action_gradient);

  /// Moves lambda by what training episodes show: `collisions` per episode lately (NaN: not known),
  /// and how many have `finished` since the last call. Nothing where none did.
  void Observe(double collisions, std::int64_t finished);

  double multiplier() const { return multiplier_; }
  void Describe(LearnerStats& stats) const;
  const at::Tensor& critic_parameters() const { return critics_.parameters(); }

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

 private:
  const ConstraintConfig config_;
  Minibatch& minibatch_;
  Totals& totals_;
  Critics critics_;
  at::Tensor target_;  // [B], y
  at::Tensor errors_;  // [B]
  double integral_;
  double multiplier_;
  double collisions_ = LearnerStats::kNone;  // At the last look.
  std::int64_t num_episodes_ = 0;            // That were looked at.
};

}  // namespace slalom::learner
