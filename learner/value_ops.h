#pragma once

#include <ATen/core/Tensor.h>

#include <span>

/// The arithmetic between networks: actions into inputs, targets and errors of values. As in
/// policy/layer_ops.h, fused on the CPU in float32 and LibTorch's operations elsewhere.
///
/// Shapes: `B` batch, `A` = 2 numbers of an action.

namespace slalom::learner {

/// to = from, both [B, A]; `to` may be columns of a wider matrix.
void CopyActions(const at::Tensor& from, at::Tensor& to);

/// to = clip(from + noise, -1, 1), all [B, A]; `to` may be columns of a wider matrix.
void AddClippedNoise(const at::Tensor& from, const at::Tensor& noise, at::Tensor& to);

/// How the values of several critics become one target: kMin guards against overestimated returns
/// (clipped double Q-learning), kMax against underestimated costs.
enum class TargetReduction { kMin, kMax };

/// y = reward + discount * the least, or largest, of the critics' values. values: [B, 1] each;
/// others [B].
void TdTarget(std::span<const at::Tensor> values, TargetReduction reduction,
              const at::Tensor& reward, const at::Tensor& discount, at::Tensor& y);

/// Gradients of -mean_i min_k q_k,i by every q_k, [B, 1] each: -1 / B where q_k is the least (the
/// first of equals), else 0. Adds the mean of the least to `value_total`, a float64 tensor with one
/// element.
void MinGradient(std::span<const at::Tensor> q, std::span<at::Tensor> dq, at::Tensor& value_total);

/// The loss mean_i (q_i - y_i)^2 and its gradient by q. q, dq: [B, 1]; y: [B].
/// Adds the loss to `loss_total` and the mean of q to `value_total`, float64 tensors with one
/// element.
void SquaredError(const at::Tensor& q, const at::Tensor& y, at::Tensor& dq, at::Tensor& loss_total,
                  at::Tensor& value_total);

/// For samples drawn by priority: dq_i *= weight_i, and share * |q_i - y_i| is added to error_i.
/// q, dq: [B, 1]; y, weight, error: [B].
void ApplyImportanceWeights(const at::Tensor& q, const at::Tensor& y, const at::Tensor& weight,
                            double share, at::Tensor& dq, at::Tensor& error);

/// Adds the mean of q to `value_total`, a float64 tensor with one element.
void AddMean(const at::Tensor& q, at::Tensor& value_total);

}  // namespace slalom::learner
