#pragma once

#include <ATen/core/Tensor.h>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/minibatch.h"
#include "learner/sliced_networks.h"
#include "policy/nn/autograd_networks.h"
#include "policy/policy.h"

/// Shapes: `B` batch, `A` numbers of an action, `P` parameters, `S` slices of a minibatch.

namespace slalom::learner {

/// The policy a = pi(s) of TD3 and DDPG, its target network, and the average of its weights, which
/// drives more steadily than the weights of any single update. It is trained in one of two ways, as
/// `Critics` are. Thread-compatible.
class DeterministicActor {
 public:
  /// The target network and the average start as copies. Keeps a reference to `minibatch`, which
  /// must outlive the actor.
  DeterministicActor(const nn::NetworkShape& shape, const policy::ActionDistribution& distribution,
                     base::Random& random, const Minibatch& minibatch);

  /// Return pi(s), and pi'(s) of the target network, [B, A], for losses; `Actions` is recorded by
  /// autograd (policy/nn/autograd_networks.h). state: [B, H * F].
  at::Tensor Actions(const at::Tensor& state) const;
  at::Tensor TargetActions(const at::Tensor& state) const;

  /// Takes one step of Adam on `loss`, a tensor with one element that depends on `Actions`, then
  /// updates target network, average and total as `PolicyGradientStep` does.
  void Descend(const at::Tensor& loss, double learning_rate, double polyak_rate,
               double average_rate, at::Tensor& norm_total);

  /// Return pi(s), and pi'(s') of the target network, [B, A]. The next call overwrites them. state,
  /// next_state: the minibatch's.
  const at::Tensor& Act(const at::Tensor& state);
  const at::Tensor& ActTarget(const at::Tensor& next_state);
  const at::Tensor& ActNext() { return ActTarget(next_state_); }

  /// Takes one step of Adam. The loss has the gradient `action_gradient` [B, A] with respect to the
  /// actions that `Act` returned, plus `preactivation_penalty` times the mean of |u|^2, where u is
  /// the input of tanh (Andrychowicz et al. 2017, appendix A). Then updates the target network at
  /// `polyak_rate` and the average at `average_rate` (0 leaves it). Adds the gradient norm to
  /// `norm_total`.
  void PolicyGradientStep(const at::Tensor& action_gradient, double preactivation_penalty,
                          double learning_rate, double polyak_rate, double average_rate,
                          at::Tensor& norm_total);

  const at::Tensor& parameters() const { return parameters_; }                  ///< [P]
  const at::Tensor& target_parameters() const { return target_parameters_; }    ///< [P]
  const at::Tensor& average_parameters() const { return average_parameters_; }  ///< [P]

  /// As `Algorithm::StartFrom`.
  void StartFrom(const at::Tensor& parameters);

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  /// Takes the step down the sum of the first `num_gradients` gradients.
  void Step(double learning_rate, double polyak_rate, double average_rate, at::Tensor& norm_total,
            int num_gradients);

  const at::Tensor state_, next_state_;  // The minibatch's.
  at::Tensor parameters_;
  at::Tensor target_parameters_;
  at::Tensor average_parameters_;
  at::Tensor gradients_;  // [S, P]
  at::Tensor gradient_;   // [P], the first of them
  Adam adam_;
  SlicedNetworks network_;
  SlicedNetworks target_;
  SlicedNetworks::Pass pass_;
  SlicedNetworks::Pass target_pass_;
  at::Tensor preactivation_;  // [B, A], inputs of tanh in the last `Act`.
  nn::AutogradNetworks functions_;
  nn::AutogradNetworks target_functions_;
};

}  // namespace slalom::learner
