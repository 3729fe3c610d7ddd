#pragma once

#include <cstdint>

#include "policy/nn/kernels/cpu_features.h"

/// Matrix products as small as those of a fully connected layer, where a BLAS spends a good part of
/// its time on what surrounds the product.

namespace slalom::nn {

/// C = op(A) op(B) + bias in float32, then ReLU or a mask; or C += op(A) op(B). All row-major.
///
/// op transposes where said. Shapes after op: `a` [m, k], `b` [k, n], `c` [m, n].
struct GemmTask {
  bool transpose_a = false;
  bool transpose_b = false;
  std::int64_t m = 0;
  std::int64_t n = 0;
  std::int64_t k = 0;
  const float* a = nullptr;
  std::int64_t lda = 0;  ///< Numbers from a row of A, as stored, to the next.
  const float* b = nullptr;
  std::int64_t ldb = 0;
  float* c = nullptr;
  std::int64_t ldc = 0;
  const float* bias = nullptr;  ///< [n], added to every row; null: none.
  bool relu = false;            ///< c = max(c, 0).
  const float* mask = nullptr;  ///< [m, n]: c = mask > 0 ? c : 0; null: none.
  std::int64_t ld_mask = 0;
  bool add = false;  ///< C += ...; without bias, ReLU and mask.
};

/// Products deeper than this are left to the BLAS.
constexpr std::int64_t kMaxSmallDepth = 1024;

/// Computes `task` where the processor has AVX2 and FMA (`cpu` may deny it more than those) and the
/// product is small; otherwise does nothing and returns false.
///
/// Each number of C starts as the bias (or 0, or itself where added to), and its k products are
/// added one after the other, each with one rounding (fused). Where n <= kMaxNarrow and A is not
/// transposed, product k goes to sum k % 16 of sixteen; these are added in turn, then the bias. So
/// the result depends neither on the processor, nor on places in memory, nor on the rest of the
/// matrix. What is not a number becomes 0 under ReLU. Thread-safe; no allocation.
[[nodiscard]] bool SmallGemm(const GemmTask& task, const CpuFeatures& cpu);

/// The widest C whose numbers are computed as scalar products of rows.
constexpr std::int64_t kMaxNarrow = 4;

}  // namespace slalom::nn
