#pragma once

#include <cstdint>

#include "policy/nn/kernels/small_gemm.h"

/// Products by weights that were packed before, one kernel for each instruction set.

namespace slalom::nn {

/// The functions of one instruction set; `SmallGemmKernel` explains them.
struct PackedKernel {
  std::int64_t (*packed_columns)(std::int64_t n);
  void (*pack)(const float* w, std::int64_t ldw, std::int64_t n, std::int64_t k, float* panels);
  void (*run)(const GemmTask& task, const float* panels, std::int64_t depth, std::int64_t first);
};

// Each in a source of its own, compiled for its instruction set. The portable one serves every
// processor, and ARM runs it.
extern const PackedKernel kPortablePackedKernel;
extern const PackedKernel kAvx2PackedKernel;
extern const PackedKernel kAvx512PackedKernel;

/// The fastest that `cpu` has.
const PackedKernel& ChoosePackedKernel(const CpuFeatures& cpu);

}  // namespace slalom::nn
