#pragma once

#include <ATen/core/Tensor.h>

#include "policy/nn/kernels/layer_ops.h"

/// The arithmetic of recurrent layers and of transformers beside their matrix products, forward and
/// backward. Results go into tensors of the caller.
///
/// Shapes: `N` rows, `W` width. Matrices may be column ranges of wider ones (their rows must be
/// dense). On the CPU and float32 these are fused kernels without allocation; on other devices and
/// types they are LibTorch's own operations. Thread-safe.

namespace slalom::nn {

/// y += x. y: [N, W]; x: [N, W], or [W] for every row.
void AddTo(const at::Tensor& x, at::Tensor& y);

/// Sets every row of y to `row`. row: [W]; y: [N, W].
void SetRows(const at::Tensor& row, at::Tensor& y);

/// Adds the sum of x's rows to `sum`. x: [N, W]; sum: [W].
void AddColumnSums(const at::Tensor& x, at::Tensor& sum);

/// y = gain * normal + bias, normal = (x - mean) * rstd over each row. x, y, normal: [N, W]; rstd:
/// [N]; gain, bias: [W]. y may be x.
void LayerNorm(const at::Tensor& gain, const at::Tensor& bias, const at::Tensor& x, at::Tensor& y,
               at::Tensor& normal, at::Tensor& rstd);

/// Computes dx from dy, or adds to dx. dx may be dy with `Into::kReplace`. dgain, dbias: [W],
/// overwritten.
void LayerNormGradient(const at::Tensor& gain, const at::Tensor& normal, const at::Tensor& rstd,
                       const at::Tensor& dy, at::Tensor& dx, at::Tensor& dgain, at::Tensor& dbias,
                       Into into = Into::kReplace);

/// y = x (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3))) / 2, GPT-2's form of GELU. Both [N, W], dense.
void Gelu(const at::Tensor& x, at::Tensor& y);

/// Passes a gradient back through `Gelu`, in place. Both [N, W], dense.
void GeluGradient(const at::Tensor& x, at::Tensor& dy);

/// One step of a gated recurrent unit (Cho et al. 2014, in the form of cuDNN and LibTorch).
///
/// With the products of the layer's input (`gates`) and of the state before (`state_gates`) by the
/// weights, biases included, each [N, 3 W] in the order reset, update, new:
///   r = sigmoid(g_r + s_r), z = sigmoid(g_z + s_z), n = tanh(g_n + r s_n),
///   after = (1 - z) n + z before.
/// Leaves r, z, n in `gates`. before, after: [N, W].
void GruStep(const at::Tensor& before, const at::Tensor& state_gates, at::Tensor& gates,
             at::Tensor& after);

/// Passes `after`'s gradient `dafter` [N, W] back through `GruStep`: replaces `gates` and
/// `state_gates` by the gradients by their values before the step, and adds the gradient through z
/// to `dbefore`, [N, W], unless that is undefined.
void GruStepGradient(const at::Tensor& before, const at::Tensor& dafter, at::Tensor& state_gates,
                     at::Tensor& gates, at::Tensor& dbefore);

}  // namespace slalom::nn
