#include "policy/nn/kernels/small_gemm.h"

namespace slalom::nn {

#if defined(__x86_64__)
// Each in a source of its own, compiled for its instruction set.
void SmallGemmAvx2(const GemmTask& task, float* scratch);
void SmallGemmAvx512(const GemmTask& task, float* scratch);

namespace {

/// The widest panel of B that a kernel packs.
constexpr std::int64_t kMaxPanel = 32;

/// Room for a panel. One per thread, as products are computed on several.
alignas(64) thread_local float panel_scratch[kMaxSmallDepth * kMaxPanel];

}  // namespace

bool SmallGemm(const GemmTask& task, const CpuFeatures& cpu) {
  if (!cpu.avx2_fma || task.k > kMaxSmallDepth) return false;
  if (cpu.avx512) {
    SmallGemmAvx512(task, panel_scratch);
  } else {
    SmallGemmAvx2(task, panel_scratch);
  }
  return true;
}
#else
bool SmallGemm(const GemmTask& /*task*/, const CpuFeatures& /*cpu*/) { return false; }
#endif

}  // namespace slalom::nn
