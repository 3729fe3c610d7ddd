#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "policy/nn/kernels/cpu_features.h"

/// OpenBLAS as packaged knows no processor that came after it, takes such ones for a Prescott and
/// is then 3 to 10 times too slow. Its kernel can only be chosen before it is loaded, by
/// OPENBLAS_CORETYPE.

namespace slalom::nn {

/// The kernel that OpenBLAS chose ("Haswell", "Prescott", ...); empty where the BLAS is another
/// one.
std::string BlasKernel();

/// The kernel to ask for instead of `kernel`: empty where that one uses what the processor can do,
/// or `user_choice` (the value of OPENBLAS_CORETYPE, if set) has been made.
std::optional<std::string> BetterBlasKernel(std::string_view kernel, const CpuFeatures& cpu,
                                            std::optional<std::string_view> user_choice);

/// Where OpenBLAS chose an old kernel, sets OPENBLAS_CORETYPE and starts this program anew in its
/// place, with the same arguments; returns otherwise. Call first in `main`, before any thread
/// starts. Happens at most once; if the restart fails, the program goes on with the slow kernel.
void RestartWithBetterBlasKernel(char** argv);

/// C = op(A) op(B), or C += op(A) op(B) with `add`, in float32, all row-major with rows `lda`,
/// `ldb`, `ldc` apart; op transposes where said. A: [m, k] after op; B: [k, n] after op; C: [m, n].
/// The BLAS behind LibTorch, called without LibTorch's dispatch, which costs as much as the
/// smallest of our products; where LibTorch hides its BLAS, LibTorch's own product. Thread-safe.
void Sgemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k,
           const float* a, std::int64_t lda, const float* b, std::int64_t ldb, float* c,
           std::int64_t ldc, bool add = false);

/// Threads that one operation of LibTorch or OpenBLAS may use (each keeps its own count).
/// Operations as small as ours are fastest on one. Requires: n >= 1.
void SetMathThreads(int n);

}  // namespace slalom::nn
