#pragma once

#include <ATen/core/Tensor.h>

#include "policy/policy.h"

/// The arithmetic of squashed Gaussian policies (SAC). As in learner/value_ops.h, fused on the CPU
/// in float32 and LibTorch's operations elsewhere.
///
/// Shapes: `B` batch, `A` = 2 numbers of an action.

namespace slalom::learner {

/// a = tanh(u), u = mean + std * noise, and
/// log pi = sum -noise^2 / 2 - log std - log sqrt(2 pi) - log(1 - a^2)
/// (Haarnoja et al. 2018, appendix C). output: [B, 2 A], means and what the deviations come of
/// (`policy::ActionDistribution`); noise, actions: [B, A]; log_probability: [B].
void SquashedSample(const policy::ActionDistribution& distribution, const at::Tensor& output,
                    const at::Tensor& noise, at::Tensor& actions, at::Tensor& log_probability);

/// Gradient by the output of a loss with gradient `daction` [B, A] by the actions, plus
/// alpha mean_i log pi_i: d log pi / du = 2 a, and d log pi / d log std = -1 besides.
/// log_temperature: log alpha, [1]; doutput: [B, 2 A].
void SquashedGradient(const policy::ActionDistribution& distribution, const at::Tensor& output,
                      const at::Tensor& noise, const at::Tensor& actions, const at::Tensor& daction,
                      const at::Tensor& log_temperature, at::Tensor& doutput);

/// y -= discount * alpha * log_probability. All [B] but `log_temperature` = log alpha, [1].
void AddEntropyBonus(const at::Tensor& discount, const at::Tensor& log_temperature,
                     const at::Tensor& log_probability, at::Tensor& y);

/// gradient = -mean (log_probability + target_entropy), [1]: by log alpha of the temperature's
/// loss. Adds the entropy, -mean log_probability, to `entropy_total` (float64, [1]).
void TemperatureGradient(const at::Tensor& log_probability, double target_entropy,
                         at::Tensor& gradient, at::Tensor& entropy_total);

}  // namespace slalom::learner
