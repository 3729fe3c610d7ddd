#include "policy/nn/kernels/cpu_features.h"

namespace slalom::nn {

CpuFeatures DetectCpuFeatures() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return {.avx2_fma = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"),
          .avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")};
#else
  return {};
#endif
}

}  // namespace slalom::nn
