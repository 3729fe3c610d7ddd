#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

namespace slalom::nn {

/// The rows of a float32 matrix on the CPU, or one row that stands for all, for loops: LibTorch
/// takes longer to say where a tensor's numbers are than a short row takes to compute.
struct TensorRows {
  /// `t`: [R, C], numbers of a row side by side, or [C]; undefined: null.
  explicit TensorRows(const at::Tensor& t)
      : data(t.defined() ? t.data_ptr<float>() : nullptr),
        stride(t.defined() && t.dim() > 1 ? t.stride(0) : 0) {}

  float* operator[](std::int64_t i) const { return data + i * stride; }

  /// What begins at row `row` and column `column`.
  TensorRows From(std::int64_t row, std::int64_t column) const {
    TensorRows part = *this;
    part.data += row * stride + column;
    return part;
  }

  float* data;
  std::int64_t stride;
};

}  // namespace slalom::nn
