#pragma once

#include <ATen/core/Tensor.h>

#include <string>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/minibatch.h"
#include "learner/sliced_networks.h"
#include "learner/value_ops.h"
#include "policy/nn/autograd_networks.h"

/// Shapes: `B` batch, `A` numbers of an action, `K` critics, `P` parameters and `O` outputs of
/// one, `S` slices of a minibatch.

namespace slalom::learner {

/// K independent action-value networks Q_k and a target network for each. Thread-compatible.
///
/// They are trained in one of two ways. The first is for losses that are written in LibTorch's
/// operations: `Values` and `TargetValues` are functions, and `Descend` takes the loss. The second
/// is for the losses of TD3, DDPG and SAC, whose gradients are written by hand: it records nothing,
/// allocates nothing, and computes only the gradients that are asked for. States must then be the
/// minibatch's own tensors, because the networks read them there.
///
/// The parameters of all K networks are one tensor [K * P]; the target networks' are another.
class Critics {
 public:
  /// The target networks start as copies. Keeps a reference to `minibatch`, which must outlive the
  /// critics. Saved tensors get names that begin with `name`.
  Critics(std::string name, const nn::NetworkShape& shape, int num_critics, base::Random& random,
          const Minibatch& minibatch);

  /// Return Q_k(s, a), and Q'_k(s, a) of the target networks, [B, K, O], for losses. `Values` is
  /// recorded by autograd: a gradient reaches the parameters and the actions
  /// (policy/nn/autograd_networks.h). state: [B, H * F]; action: [B, A].
  at::Tensor Values(const at::Tensor& state, const at::Tensor& action) const;
  at::Tensor TargetValues(const at::Tensor& state, const at::Tensor& action) const;

  /// Takes one step of Adam on `loss`, a tensor with one element that depends on `Values`, then
  /// updates the target networks at `polyak_rate` (0 leaves them). Adds the gradient's norm to
  /// `norm_total`, a float64 tensor with one element.
  void Descend(const at::Tensor& loss, double learning_rate, double polyak_rate,
               at::Tensor& norm_total);

  /// Computes the TD target y = reward + discount * min_k (or max_k) Q'_k(s', a') with the target
  /// networks. next_state: the minibatch's; next_action: [B, A]; the others: [B].
  void ComputeTdTarget(const at::Tensor& next_state, const at::Tensor& next_action,
                       const at::Tensor& reward, const at::Tensor& discount,
                       TargetReduction reduction, at::Tensor& y);

  /// Weights and errors of samples that were drawn by priority.
  struct Importance {
    const at::Tensor& weight;  ///< [B], input: importance weights
    at::Tensor& td_error;      ///< [B], output: mean over the critics of |Q_k(s, a) - y|
  };

  /// Takes one step of Adam on sum_k mean (Q_k(s, a) - y)^2, then updates the target networks at
  /// `polyak_rate` (0 leaves them). Adds loss, mean Q and gradient norm to their totals (float64
  /// tensors with one element). With `importance`, each sample's gradient is multiplied by its
  /// weight, and the TD errors are written. state: the minibatch's; action: [B, A].
  void GradientStep(const at::Tensor& state, const at::Tensor& action, const at::Tensor& y,
                    double learning_rate, double polyak_rate, at::Tensor& loss_total,
                    at::Tensor& value_total, at::Tensor& norm_total,
                    const Importance* importance = nullptr);

  /// Returns the gradient of -mean Q_1(s, a) with respect to the actions, [B, A]. The next call
  /// overwrites it. Adds mean Q_1 to `value_total`, unless null. state: the minibatch's.
  at::Tensor& ActionGradient(const at::Tensor& state, const at::Tensor& action,
                             at::Tensor* value_total);

  /// As `ActionGradient`, for -mean min_k Q_k(s, a).
  at::Tensor& MinActionGradient(const at::Tensor& state, const at::Tensor& action,
                                at::Tensor& value_total);

  int size() const { return num_critics_; }
  const at::Tensor& parameters() const { return parameters_; }                ///< [K * P]
  const at::Tensor& target_parameters() const { return target_parameters_; }  ///< [K * P]

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  /// Copies the action behind the state, where the networks read it. Requires: the minibatch's
  /// state.
  void SetAction(const at::Tensor& state, const at::Tensor& action);
  /// Takes the step down the sum of the first `num_gradients` gradients.
  void Step(double learning_rate, double polyak_rate, at::Tensor& norm_total, int num_gradients);

  const std::string name_;
  const int num_critics_;
  const at::Tensor state_, next_state_;  // The minibatch's.
  at::Tensor room_, next_room_;  // Places behind the states, where the networks read actions.
  at::Tensor parameters_;
  at::Tensor target_parameters_;
  at::Tensor gradients_;  // [S, K * P]
  at::Tensor gradient_;   // [K * P], the first of them
  Adam adam_;
  SlicedNetworks networks_;
  SlicedNetworks target_networks_;
  SlicedNetworks::Pass pass_;
  SlicedNetworks::Pass target_pass_;
  nn::AutogradNetworks functions_;
  nn::AutogradNetworks target_functions_;
};

}  // namespace slalom::learner
