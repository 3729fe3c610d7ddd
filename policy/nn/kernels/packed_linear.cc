#include "policy/nn/kernels/packed_linear.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::nn {

const PackedKernel& ChoosePackedKernel([[maybe_unused]] const CpuFeatures& cpu) {
#if defined(__x86_64__)
  if (cpu.avx2_fma && cpu.avx512) return kAvx512PackedKernel;
  if (cpu.avx2_fma) return kAvx2PackedKernel;
#endif
  return kPortablePackedKernel;
}

PackedLinear::PackedLinear(std::int64_t inputs, std::int64_t outputs, const CpuFeatures& cpu)
    : inputs_(inputs), outputs_(outputs), kernel_(&ChoosePackedKernel(cpu)) {
  SLALOM_CHECK(inputs > 0 && outputs > 0);
  const std::int64_t numbers = kernel_->packed_columns(outputs) * inputs;
  panels_.resize(static_cast<std::size_t>((numbers + 15) / 16));
  bias_.resize(static_cast<std::size_t>(outputs));
}

void PackedLinear::SetWeights(const float* weight, const float* bias) {
  kernel_->pack(weight, inputs_, outputs_, inputs_, panels_.front().numbers);
  std::copy_n(bias, outputs_, bias_.begin());
}

void PackedLinear::ForwardPart(std::int64_t rows, Rows x, std::int64_t first, std::int64_t count,
                               bool relu, Rows y) const {
  SLALOM_CHECK(rows > 0 && first >= 0 && count > 0 && first + count <= inputs_);
  SLALOM_CHECK_GE(y.stride, rows == 1 ? 0 : outputs_);
  kernel_->run({.m = rows,
                .n = outputs_,
                .k = count,
                .a = x.data,
                .lda = x.stride,
                .c = y.data,
                .ldc = y.stride,
                .bias = bias_.data(),
                .relu = relu},
               panels_.front().numbers, inputs_, first);
}

}  // namespace slalom::nn
