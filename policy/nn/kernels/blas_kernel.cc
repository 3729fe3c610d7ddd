#include "policy/nn/kernels/blas_kernel.h"

#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>

namespace slalom::nn {
namespace {

constexpr const char* kChoiceVariable = "OPENBLAS_CORETYPE";

/// Kernels of OpenBLAS that use neither AVX2 nor AVX-512.
constexpr std::array<std::string_view, 18> kOldKernels = {
    "Katmai",       "Coppermine", "Northwood",  "Prescott", "Banias",      "Atom",
    "Core2",        "Penryn",     "Dunnington", "Nehalem",  "Athlon",      "Opteron",
    "Opteron_SSE3", "Barcelona",  "Bobcat",     "Nano",     "Sandybridge", "Generic"};

}  // namespace

std::string BlasKernel() {
  const auto get_corename =
      reinterpret_cast<char* (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_corename"));
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

}  // namespace slalom::nn
