#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/minibatch.h"
#include "policy/network.h"
#include "policy/policy.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action, `P` parameters.

namespace slalom::learner {

/// The policy a = pi(s) of TD3 and DDPG, its target network and the average of its weights, which
/// scores more steadily than the actor itself (docs/training.md). Thread-compatible.
class DeterministicActor {
 public:
  /// Target and average start as copies. The passes are bound to `minibatch`, which must outlive
  /// this.
  DeterministicActor(const policy::NetworkShape& shape,
                     const policy::ActionDistribution& distribution, base::Random& random,
                     const Minibatch& minibatch);

  /// pi(s) and pi'(s'). Returns [B, A], overwritten by the next call.
  const at::Tensor& Act();
  const at::Tensor& ActTarget();
  const at::Tensor& ActNext() { return ActTarget(); }

  /// One step of Adam, after `Act`, on a loss whose gradient by the actions is `action_gradient`,
  /// [B, A], plus `preactivation_penalty` times the mean of |u|^2, u being what tanh is taken of
  /// (Andrychowicz et al. 2017, appendix A). The target follows at `polyak_rate`, the average at
  /// `average_rate` (0: not). Adds the gradient norm to `norm_total`.
  void Improve(const at::Tensor& action_gradient, double preactivation_penalty,
               double learning_rate, double polyak_rate, double average_rate,
               at::Tensor& norm_total);

  const at::Tensor& parameters() const { return parameters_; }                  ///< [P]
  const at::Tensor& target_parameters() const { return target_parameters_; }    ///< [P]
  const at::Tensor& average_parameters() const { return average_parameters_; }  ///< [P]

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

 private:
  at::Tensor parameters_;
  at::Tensor target_parameters_;
  at::Tensor average_parameters_;
  at::Tensor gradient_;
  Adam adam_;
  policy::Network network_;
  policy::Network target_;
  policy::Network network_gradient_;
  policy::NetworkPass pass_;
  policy::NetworkPass target_pass_;
  at::Tensor preactivation_;  // [B, A] of the last Act.
};

}  // namespace slalom::learner
