#pragma once

#include <ATen/core/Tensor.h>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/gaussian_ops.h"
#include "learner/minibatch.h"
#include "policy/network.h"
#include "policy/policy.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action, `P` parameters.

namespace slalom::learner {

/// Actions drawn from a policy, with their log density. Views that the next draw overwrites.
struct SampledActions {
  const at::Tensor& actions;          ///< [B, A]
  const at::Tensor& log_probability;  ///< [B], log pi(a|s)
};

/// The stochastic policy of SAC: a = tanh(mean(s) + std(s) * noise), each action number on its own,
/// with the average of its weights. There is no target network. Thread-compatible.
class GaussianActor {
 public:
  /// `distribution`: bounds of the standard deviation. The average starts as a copy. The passes are
  /// bound to `minibatch`, which must outlive this.
  GaussianActor(const policy::NetworkShape& shape, const policy::ActionDistribution& distribution,
                base::Random& random, const Minibatch& minibatch);

  /// a ~ pi(.|s) and a' ~ pi(.|s') by standard normal numbers [B, A].
  SampledActions Sample(const at::Tensor& noise) { return Draw(now_, noise); }
  SampledActions SampleNext(const at::Tensor& noise) { return Draw(next_, noise); }

  /// The mode tanh(mean(s')). Overwritten by the next call.
  const at::Tensor& ActNext();

  /// One step of Adam, after `Sample`, on mean_i alpha log pi(a_i|s_i) plus a loss whose gradient
  /// by the actions is `action_gradient`, [B, A]. `log_temperature`: log alpha, [1].
  void PolicyGradientStep(const at::Tensor& action_gradient, const at::Tensor& log_temperature,
                          double learning_rate, double average_rate, at::Tensor& norm_total);

  const at::Tensor& parameters() const { return parameters_; }                  ///< [P]
  const at::Tensor& average_parameters() const { return average_parameters_; }  ///< [P]

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

 private:
  struct Draws {
    policy::NetworkPass pass;    // Output [B, 2 A]: mean, and what the deviation comes of.
    at::Tensor actions;          // [B, A]
    at::Tensor log_probability;  // [B]
  };

  SampledActions Draw(Draws& draws, const at::Tensor& noise);

  const policy::ActionDistribution distribution_;
  at::Tensor parameters_;
  at::Tensor average_parameters_;
  at::Tensor gradient_;
  Adam adam_;
  policy::Network network_;
  policy::Network network_gradient_;
  Draws now_;
  Draws next_;
  at::Tensor noise_;  // [B, A], of the last `Sample`.
};

}  // namespace slalom::learner
