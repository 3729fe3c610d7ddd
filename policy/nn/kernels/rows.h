#pragma once

#include <cstdint>

namespace slalom::nn {

/// The rows of a float32 matrix. With a stride of 0, one row stands for all. A view.
struct Rows {
  float* data = nullptr;
  std::int64_t stride = 0;  ///< Numbers from the beginning of a row to the next row's.

  float* operator[](std::int64_t i) const { return data + i * stride; }

  /// The part that begins at row `row` and column `column`.
  Rows From(std::int64_t row, std::int64_t column) const {
    return {data + row * stride + column, stride};
  }
};

}  // namespace slalom::nn
