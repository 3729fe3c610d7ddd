#include "policy/nn/kernels/blas.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <dlfcn.h>

#include "base/check.h"

namespace slalom::nn {
namespace {

template <class Function>
Function Find(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_DEFAULT, name));
}

/// The Fortran interface, column-major, that every BLAS has.
using FortranSgemm = void (*)(const char* transa, const char* transb, const int* m, const int* n,
                              const int* k, const float* alpha, const float* a, const int* lda,
                              const float* b, const int* ldb, const float* beta, float* c,
                              const int* ldc);

/// A row-major matrix as LibTorch sees it.
at::Tensor View(const float* data, std::int64_t rows, std::int64_t columns, std::int64_t stride,
                bool transpose) {
  float* const values = const_cast<float*>(data);
  return transpose ? at::from_blob(values, {columns, rows}, {stride, 1}, at::kFloat).t()
                   : at::from_blob(values, {rows, columns}, {stride, 1}, at::kFloat);
}

}  // namespace

void Sgemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k,
           const float* a, std::int64_t lda, const float* b, std::int64_t ldb, float* c,
           std::int64_t ldc, bool add) {
  static const auto sgemm = Find<FortranSgemm>("sgemm_");
  // Rows that overlap, as the windows of a convolution do, are more than a BLAS takes.
  const bool overlapping = lda < (transpose_a ? m : k) || ldb < (transpose_b ? k : n);
  if (sgemm == nullptr || overlapping) {
    at::Tensor result = View(c, m, n, ldc, false);
    const at::Tensor left = View(a, m, k, lda, transpose_a);
    const at::Tensor right = View(b, k, n, ldb, transpose_b);
    if (add) {
      result.addmm_(left, right);
    } else {
      at::mm_out(result, left, right);
    }
    return;
  }
  // A row-major C = A B is the column-major C^T = B^T A^T.
  const int rows = static_cast<int>(n), columns = static_cast<int>(m), depth = static_cast<int>(k);
  const int b_stride = static_cast<int>(ldb), a_stride = static_cast<int>(lda);
  const int c_stride = static_cast<int>(ldc);
  const float one = 1.0f, before = add ? 1.0f : 0.0f;
  sgemm(transpose_b ? "T" : "N", transpose_a ? "T" : "N", &rows, &columns, &depth, &one, b,
        &b_stride, a, &a_stride, &before, c, &c_stride);
}

void SetMathThreads(int n) {
  SLALOM_CHECK_GE(n, 1);
  at::set_num_threads(n);
  const auto set_num_threads = Find<void (*)(int)>("openblas_set_num_threads");
  if (set_num_threads != nullptr) set_num_threads(n);
}

}  // namespace slalom::nn
