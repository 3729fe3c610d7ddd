#pragma once

namespace slalom::nn {

/// The instruction sets of the processor that kernels ask for.
struct CpuFeatures {
  bool avx2_fma = false;
  bool avx512 = false;  ///< F, BW, DQ, VL.
};

CpuFeatures DetectCpuFeatures();

}  // namespace slalom::nn
