#pragma once

#include <ATen/core/Tensor.h>

#include "policy/policy.h"

/// The arithmetic of squashed Gaussian policies (SAC). As in learner/value_ops.h, it is fused for
/// float32 on the CPU and uses LibTorch's operations elsewhere.
///
/// Shapes: `B` batch, `A` numbers of an action.

namespace slalom::learner {

/// Actions drawn from a policy and their log densities.
struct DrawnActions {
  at::Tensor action;           ///< [B, A]
  at::Tensor log_probability;  ///< [B], log pi(a|s)
};

/// a = tanh(u), u = mean + std * noise, and
/// log pi = sum -noise^2 / 2 - log std - log sqrt(2 pi) - log(1 - a^2)
/// (Haarnoja et al. 2018, appendix C), in LibTorch's operations, so that autograd differentiates
/// it. output: [B, 2 A], the means, then raw values that `policy::ActionDistribution` maps to
/// standard deviations; noise: [B, A].
DrawnActions SquashedDraw(const policy::ActionDistribution& distribution, const at::Tensor& output,
                          const at::Tensor& noise);

/// Computes the same into existing memory. actions: [B, A]; log_probability: [B].
void SquashedSample(const policy::ActionDistribution& distribution, const at::Tensor& output,
                    const at::Tensor& noise, at::Tensor& actions, at::Tensor& log_probability);

/// Computes `doutput` [B, 2 A], the gradient of alpha mean_i log pi_i plus a loss with the gradient
/// `daction` [B, A] with respect to the actions. It uses d log pi / du = 2 a; in addition,
/// d log pi / d log std has the direct term -1. log_temperature: log alpha, [1].
void SquashedGradient(const policy::ActionDistribution& distribution, const at::Tensor& output,
                      const at::Tensor& noise, const at::Tensor& actions, const at::Tensor& daction,
                      const at::Tensor& log_temperature, at::Tensor& doutput);

/// Adds the entropy bonus of the next action to a TD target: y -= discount * alpha *
/// log_probability. All [B] except `log_temperature` = log alpha, [1].
void AddEntropyBonus(const at::Tensor& discount, const at::Tensor& log_temperature,
                     const at::Tensor& log_probability, at::Tensor& y);

/// Computes the gradient of the temperature's loss with respect to log alpha:
/// -mean (log_probability + target_entropy), [1]. Adds the entropy, -mean log_probability, to
/// `entropy_total` (float64, [1]).
void TemperatureGradient(const at::Tensor& log_probability, double target_entropy,
                         at::Tensor& gradient, at::Tensor& entropy_total);

}  // namespace slalom::learner
