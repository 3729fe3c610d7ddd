#pragma once

#include <ATen/core/Tensor.h>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/gaussian_ops.h"
#include "learner/minibatch.h"
#include "learner/sliced_networks.h"
#include "policy/nn/autograd_networks.h"
#include "policy/policy.h"

/// Shapes: `B` batch, `A` numbers of an action, `P` parameters.

namespace slalom::learner {

/// The views of `DrawnActions`, which the next draw overwrites.
struct SampledActions {
  const at::Tensor& action;
  const at::Tensor& log_probability;
};

/// The stochastic policy of SAC, a = tanh(mean(s) + std(s) * noise) with independent components,
/// and the average of its weights. It has no target network. It is trained in one of two ways, as
/// `Critics` are. Thread-compatible.
class GaussianActor {
 public:
  /// `distribution` bounds the standard deviation. The average starts as a copy. Keeps a reference
  /// to `minibatch`, which must outlive the actor.
  GaussianActor(const nn::NetworkShape& shape, const policy::ActionDistribution& distribution,
                base::Random& random, const Minibatch& minibatch);

  /// Draws a ~ pi(.|s), for losses: recorded by autograd (policy/nn/autograd_networks.h), and a
  /// function of `noise`, standard normal numbers, [B, A]. state: [B, H * F].
  DrawnActions Draw(const at::Tensor& state, const at::Tensor& noise) const;

  /// Takes one step of Adam on `loss`, a tensor with one element that depends on `Draw`, then
  /// updates average and total as `PolicyGradientStep` does.
  void Descend(const at::Tensor& loss, double learning_rate, double average_rate,
               at::Tensor& norm_total);

  /// Draw a ~ pi(.|s), and a' ~ pi(.|s'). `noise`: standard normal numbers, [B, A]. state,
  /// next_state: the minibatch's.
  SampledActions Sample(const at::Tensor& state, const at::Tensor& noise);
  SampledActions SampleNext(const at::Tensor& next_state, const at::Tensor& noise);

  /// Returns the mode tanh(mean(s')), [B, A]. The next call overwrites it.
  const at::Tensor& ActNext();

  /// Takes one step of Adam on mean_i alpha log pi(a_i|s_i) plus a loss whose gradient with respect
  /// to the actions of the last `Sample` is `action_gradient`, [B, A]. `log_temperature`: log
  /// alpha, [1]. Then updates the average at `average_rate` (0 leaves it).
  void PolicyGradientStep(const at::Tensor& action_gradient, const at::Tensor& log_temperature,
                          double learning_rate, double average_rate, at::Tensor& norm_total);

  const at::Tensor& parameters() const { return parameters_; }                  ///< [P]
  const at::Tensor& average_parameters() const { return average_parameters_; }  ///< [P]

  /// As `Algorithm::StartFrom`.
  void StartFrom(const at::Tensor& parameters);

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  struct Draws {
    SlicedNetworks::Pass pass;   // Output [B, 2 A]: means, then raw standard deviations.
    at::Tensor actions;          // [B, A]
    at::Tensor log_probability;  // [B]
  };

  SampledActions Sample(Draws& draws, const at::Tensor& noise);
  /// Takes the step down the sum of the first `num_gradients` gradients.
  void Step(double learning_rate, double average_rate, at::Tensor& norm_total, int num_gradients);

  const policy::ActionDistribution distribution_;
  const at::Tensor state_, next_state_;  // The minibatch's.
  at::Tensor parameters_;
  at::Tensor average_parameters_;
  at::Tensor gradients_;  // [S, P]
  at::Tensor gradient_;   // [P], the first of them
  Adam adam_;
  SlicedNetworks network_;
  Draws now_;
  Draws next_;
  at::Tensor noise_;  // [B, A], noise of the last `Sample`.
  nn::AutogradNetworks functions_;
};

}  // namespace slalom::learner
