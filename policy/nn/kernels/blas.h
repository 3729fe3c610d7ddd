#pragma once

#include <cstdint>

namespace slalom::nn {

/// C = op(A) op(B), or C += op(A) op(B) with `add`, in float32, all row-major with rows `lda`,
/// `ldb`, `ldc` apart; op transposes if asked to. A: [m, k] after op; B: [k, n] after op; C: [m,
/// n]. Calls the BLAS behind LibTorch without LibTorch's dispatch, which costs as much as the
/// smallest of our products. If LibTorch hides its BLAS, calls LibTorch's own product. Thread-safe.
void Sgemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k,
           const float* a, std::int64_t lda, const float* b, std::int64_t ldb, float* c,
           std::int64_t ldc, bool add = false);

/// Sets the number of threads that one operation of LibTorch or OpenBLAS may use (each keeps its
/// own count). Operations as small as ours are fastest on one. Requires: n >= 1.
void SetMathThreads(int n);

}  // namespace slalom::nn
