#pragma once

#include <ATen/core/Tensor.h>

#include "policy/nn/kernels/rows.h"

namespace slalom::nn {

/// The rows of a float32 tensor on the CPU, for loops: LibTorch takes longer to say where a
/// tensor's numbers are than a short row takes to compute.
struct TensorRows : Rows {
  /// `t`: [R, C], numbers of a row side by side, or [C]; undefined: null.
  explicit TensorRows(const at::Tensor& t)
      : Rows{t.defined() ? t.data_ptr<float>() : nullptr,
             t.defined() && t.dim() > 1 ? t.stride(0) : 0} {}
};

}  // namespace slalom::nn
