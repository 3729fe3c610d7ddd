#pragma once

#include <ATen/core/Tensor.h>

#include "policy/nn/kernels/rows.h"

namespace slalom::nn {

/// The rows of a float32 tensor on the CPU, for loops: asking LibTorch for a tensor's address takes
/// longer than computing a short row.
struct TensorRows : Rows {
  /// `t`: [R, C] with dense rows, or [C]. An undefined tensor gives null rows.
  explicit TensorRows(const at::Tensor& t)
      : Rows{t.defined() ? t.data_ptr<float>() : nullptr,
             t.defined() && t.dim() > 1 ? t.stride(0) : 0} {}
};

}  // namespace slalom::nn
