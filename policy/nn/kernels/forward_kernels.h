#pragma once

#include <cstdint>
#include <span>

#include "base/random.h"
#include "policy/nn/kernels/rows.h"

/// The forward arithmetic of layers beside their matrix products, on float32 in host memory and
/// without LibTorch. Training (policy/nn/kernels/layer_ops.h, policy/nn/kernels/sequence_ops.h,
/// policy/nn/kernels/attention.h) and acting (policy/nn/inference/) both call these, so that both
/// compute the same bits.
///
/// Every sum has one order and no operation is fused, so the results do not depend on the
/// processor. Nothing is allocated. Thread-safe.
///
/// Shapes: `N` rows, `W` columns. Rows may lie further apart than they are wide.

namespace slalom::nn {

struct MatrixSize {
  std::int64_t rows = 0;     ///< N
  std::int64_t columns = 0;  ///< W
};

/// y += x. x: [N, W], or [W] with a stride of 0; y: [N, W].
void AddRows(MatrixSize size, Rows x, Rows y);

/// y = gain * normal + bias, normal = (x - mean) * rstd over each row. x, y, normal: [N, W]; rstd:
/// [N]; gain, bias: [W]. y may be x.
void LayerNormRows(MatrixSize size, const float* gain, const float* bias, Rows x, Rows y,
                   Rows normal, float* rstd);

/// LayerNorm over each row and ReLU, in place: y = max(0, gain * normal + bias). Shapes as above.
void LayerNormReluRows(MatrixSize size, const float* gain, const float* bias, Rows y, Rows normal,
                       float* rstd);

/// y = x (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3))) / 2. x, y: [n], apart from each other.
void GeluNumbers(const float* x, std::int64_t n, float* y);

/// One step of a gated recurrent unit; policy/nn/kernels/sequence_ops.h, `GruStep`, has its
/// formula. before, after: [N, W]; state_gates, gates: [N, 3 W].
void GruStepRows(MatrixSize size, Rows before, Rows state_gates, Rows gates, Rows after);

/// Sizes of causal attention: sequences, heads, queries, tokens, and columns of a head.
struct AttentionSizes {
  std::int64_t batch = 0;    ///< B
  std::int64_t heads = 0;    ///< A
  std::int64_t queries = 0;  ///< Q, the last tokens.
  std::int64_t tokens = 0;   ///< T
  std::int64_t width = 0;    ///< D / A
};

/// Causal self-attention; policy/nn/kernels/attention.h, `Attend`, has its formula. query, result:
/// [B * Q, D]; key, value: [B * T, D]; mask (or null), weights: [B, A, Q, T].
void AttendRows(const AttentionSizes& sizes, Rows query, Rows key, Rows value, const float* mask,
                float* weights, Rows result);

/// Draws the factor of each number under dropout: 0 with probability `rate`, else 1 / (1 - rate).
/// Requires: 0 < rate < 1.
void DrawDropoutMask(double rate, base::Random& random, std::span<float> mask);

/// y *= mask. mask, y: [n].
void ApplyDropoutMask(std::span<const float> mask, float* y);

}  // namespace slalom::nn
