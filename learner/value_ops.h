#pragma once

#include <ATen/core/Tensor.h>

#include <span>

/// The arithmetic between networks: copying actions into inputs, TD targets, losses and their
/// gradients. As in policy/nn/kernels/layer_ops.h, it is fused for float32 on the CPU and uses
/// LibTorch's operations elsewhere.
///
/// Shapes: `B` batch, `A` numbers of an action.

namespace slalom::learner {

/// to = from, both [B, A]; `to` may be columns of a wider matrix.
void CopyActions(const at::Tensor& from, at::Tensor& to);

/// to = clip(from + noise, -1, 1), all [B, A]; `to` may be columns of a wider matrix.
void AddClippedNoise(const at::Tensor& from, const at::Tensor& noise, at::Tensor& to);

/// How the values of several critics become one target: kMin guards against overestimated returns
/// (clipped double Q-learning), kMax against underestimated costs.
enum class TargetReduction { kMin, kMax };

/// y = reward + discount * min_k (or max_k) values[k]. values: [B, 1] each; the others: [B].
void TdTarget(std::span<const at::Tensor> values, TargetReduction reduction,
              const at::Tensor& reward, const at::Tensor& discount, at::Tensor& y);

/// Computes the gradient of -mean_i min_k q_k,i with respect to every q_k, [B, 1] each: -1 / B if
/// q_k is the minimum (the first of equals), else 0. Adds the mean of the minimum to `value_total`,
/// a float64 tensor with one element.
void MinGradient(std::span<const at::Tensor> q, std::span<at::Tensor> dq, at::Tensor& value_total);

/// Computes the gradient dq of the loss mean_i (q_i - y_i)^2. q, dq: [B, 1]; y: [B].
/// Adds the loss to `loss_total` and the mean of q to `value_total`, float64 tensors with one
/// element.
void SquaredError(const at::Tensor& q, const at::Tensor& y, at::Tensor& dq, at::Tensor& loss_total,
                  at::Tensor& value_total);

/// Corrects for samples that were drawn by priority: dq_i *= weight_i. Also adds
/// share * |q_i - y_i| to error_i. q, dq: [B, 1]; y, weight, error: [B].
void ApplyImportanceWeights(const at::Tensor& q, const at::Tensor& y, const at::Tensor& weight,
                            double share, at::Tensor& dq, at::Tensor& error);

/// Adds the mean of q to `value_total`, a float64 tensor with one element.
void AddMean(const at::Tensor& q, at::Tensor& value_total);

}  // namespace slalom::learner
