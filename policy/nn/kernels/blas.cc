#include "policy/nn/kernels/blas.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/check.h"

namespace slalom::nn {
namespace {

constexpr const char* kChoiceVariable = "OPENBLAS_CORETYPE";

/// Kernels of OpenBLAS that use neither AVX2 nor AVX-512.
constexpr std::array<std::string_view, 18> kOldKernels = {
    "Katmai",       "Coppermine", "Northwood",  "Prescott", "Banias",      "Atom",
    "Core2",        "Penryn",     "Dunnington", "Nehalem",  "Athlon",      "Opteron",
    "Opteron_SSE3", "Barcelona",  "Bobcat",     "Nano",     "Sandybridge", "Generic"};

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

std::string BlasKernel() {
  const auto get_corename = Find<char* (*)()>("openblas_get_corename");
  return get_corename == nullptr ? "" : get_corename();
}

std::optional<std::string> BetterBlasKernel(std::string_view kernel, const CpuFeatures& cpu,
                                            std::optional<std::string_view> user_choice) {
  const auto same = [&](std::string_view old) {
    return std::equal(old.begin(), old.end(), kernel.begin(), kernel.end(),
                      [](char a, char b) { return (a | 0x20) == (b | 0x20); });
  };
  if (user_choice || std::none_of(kOldKernels.begin(), kOldKernels.end(), same))
    return std::nullopt;
  if (cpu.avx512) return "SkylakeX";
  if (cpu.avx2_fma) return "Haswell";
  return std::nullopt;
}

void RestartWithBetterBlasKernel(char** argv) {
  const char* const choice = std::getenv(kChoiceVariable);
  const auto better =
      BetterBlasKernel(BlasKernel(), DetectCpuFeatures(),
                       choice == nullptr ? std::nullopt : std::optional<std::string_view>(choice));
  if (!better) return;
  // The variable set here is the user's choice to the restarted program: it will not restart again.
  setenv(kChoiceVariable, better->c_str(), /*overwrite=*/1);
  execv("/proc/self/exe", argv);
}

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
