#pragma once

namespace slalom::nn {

/// What the processor can do, as far as a kernel asks for it.
struct CpuFeatures {
  bool avx2_fma = false;
  bool avx512 = false;  ///< F, BW, DQ, VL.
};

CpuFeatures DetectCpuFeatures();

}  // namespace slalom::nn
