#pragma once

#include <ATen/core/Tensor.h>

/// Causal self-attention of several heads (Vaswani et al. 2017, section 3.2), forward and backward.
///
/// Shapes: `B` batch, `T` tokens of a sequence, `Q` <= T queries, which are the last tokens, `D`
/// width, `A` heads, each on D / A columns. Rows of keys and values are [B * T], of queries [B *
/// Q], token after token of each sequence. Matrices may be column ranges of wider ones. On the CPU
/// and float32 these are kernels without allocation; on other devices and types LibTorch's own
/// operations. Thread-safe.

namespace slalom::nn {

struct AttentionInput {
  at::Tensor query;         ///< [B * Q, D]
  at::Tensor key;           ///< [B * T, D]
  at::Tensor value;         ///< [B * T, D]
  at::Tensor dropout_mask;  ///< [B, A, Q, T], factor of each weight; or undefined.
};

/// weights = softmax(query key^T / sqrt(D / A)) over the tokens up to the query's own, 0 beyond;
/// result = (weights * dropout_mask) value, head by head. weights: [B, A, Q, T]; result: [B * Q,
/// D].
void Attend(const AttentionInput& input, at::Tensor& weights, at::Tensor& result);

/// Gradients by query, key and value from `dresult`, after `Attend`.
void AttendGradient(const AttentionInput& input, const at::Tensor& weights,
                    const at::Tensor& dresult, at::Tensor& dquery, at::Tensor& dkey,
                    at::Tensor& dvalue);

}  // namespace slalom::nn
