#pragma once

#include <ATen/core/Tensor.h>

/// The arithmetic of fully connected layers, forward and backward. Results go into tensors of the
/// caller.
///
/// Shapes: `B` batch, `I` inputs, `O` outputs of a layer. Matrices may be column ranges of wider
/// ones (their rows must be dense). On the CPU and float32 these are fused kernels without
/// allocation or dispatch, around `SmallGemm` or else the BLAS; on other devices and types they are
/// LibTorch's own operations. Thread-safe.

namespace slalom::nn {

/// Whether a result overwrites its destination or is added to it.
enum class Into { kReplace, kAdd };

/// y = x w^T + b, then ReLU if `relu`. x: [B, I]; w: [O, I]; b: [O]; y: [B, O].
void Linear(const at::Tensor& x, const at::Tensor& w, const at::Tensor& b, bool relu,
            at::Tensor& y);

/// Gradients of a loss by w and b, from `dy`, its gradient by y. dy: [B, O]; dw: [O, I]; db: [O].
void LinearWeightGradient(const at::Tensor& x, const at::Tensor& dy, at::Tensor& dw, at::Tensor& db,
                          Into into = Into::kReplace);

/// dx = dy w, the gradient by x. If x = max(0, ...) is the output of a ReLU, `relu_output` is that
/// x, and dx is passed back through the ReLU: 0 if x <= 0. Otherwise `relu_output` is an undefined
/// tensor. dx: [B, I]. Requires: no `relu_output` with `Into::kAdd`.
void LinearInputGradient(const at::Tensor& dy, const at::Tensor& w, const at::Tensor& relu_output,
                         at::Tensor& dx, Into into = Into::kReplace);

/// Sets dy to 0 if y, the output of a ReLU, is 0. Both [B, O].
void ReluGradient(const at::Tensor& y, at::Tensor& dy);

/// LayerNorm over each row and ReLU, in place: y = max(0, gain * normal + bias), normal = (y -
/// mean) * rstd. y, normal: [B, O]; rstd: [B]; gain, bias: [O].
void LayerNormRelu(const at::Tensor& gain, const at::Tensor& bias, at::Tensor& y,
                   at::Tensor& normal, at::Tensor& rstd);

/// Passes a gradient back through `LayerNormRelu`, in place.
/// `dgain`, `dbias`: gradients by gain and bias; undefined tensors if not wanted.
void LayerNormReluGradient(const at::Tensor& gain, const at::Tensor& y, const at::Tensor& normal,
                           const at::Tensor& rstd, at::Tensor& dy, at::Tensor& dgain,
                           at::Tensor& dbias);

/// y = tanh(y), in place. y: [B, O], dense.
void Tanh(at::Tensor& y);

/// Passes a gradient back through y = tanh(x), in place: dy = dy (1 - y^2). Both [B, O], dense.
void TanhGradient(const at::Tensor& y, at::Tensor& dy);

/// Whether the fused kernels serve a tensor: float32 in host memory.
inline bool IsHostFloat(const at::Tensor& t) {
  return t.device().is_cpu() && t.scalar_type() == at::kFloat;
}

}  // namespace slalom::nn
