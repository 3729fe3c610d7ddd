#pragma once

#include <cstdint>

#include "policy/nn/kernels/cpu_features.h"

/// Matrix products as small as a fully connected layer's. A BLAS spends a good part of its time on
/// them outside the product itself.

namespace slalom::nn {

/// C = op(A) op(B) + bias in float32, then ReLU or a mask; or C += op(A) op(B). All row-major.
///
/// op transposes if asked to. Shapes after op: `a` [m, k], `b` [k, n], `c` [m, n].
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
  const float* bias = nullptr;  ///< [n], added to every row; null for none.
  bool relu = false;            ///< c = max(c, 0).
  const float* mask = nullptr;  ///< [m, n]: c = mask > 0 ? c : 0; null for none.
  std::int64_t ld_mask = 0;
  bool add = false;  ///< C += ...; without bias, ReLU and mask.
};

/// Products deeper than this are left to the BLAS.
constexpr std::int64_t kMaxSmallDepth = 1024;

/// Computes `task` if the processor has AVX2 and FMA and the product is small; otherwise does
/// nothing and returns false. `cpu` may deny features that the processor has.
///
/// Each number of C starts as the bias, as 0, or as itself with `add`. Its k products are added one
/// after the other, each with one rounding (fused). If n <= kMaxNarrow and A is not transposed,
/// product k goes to partial sum k % 16; the sixteen sums are added in turn, then the bias. So the
/// result depends neither on the processor, nor on addresses, nor on the rest of the matrix. NaN
/// becomes 0 under ReLU. Thread-safe; no allocation.
[[nodiscard]] bool SmallGemm(const GemmTask& task, const CpuFeatures& cpu);

/// Largest width of a C that is computed by scalar products of rows.
constexpr std::int64_t kMaxNarrow = 4;

}  // namespace slalom::nn
