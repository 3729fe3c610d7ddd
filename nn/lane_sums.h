#pragma once

#include <cstdint>

/// Sums that vectorise and yet give the same number on every processor, for the kernels of
/// nn/layer_ops.cc and nn/sequence_ops.cc.

namespace slalom::nn {

/// Numbers that are summed side by side, so that sums vectorise in an order that is always the
/// same.
inline constexpr int kLanes = 16;

/// By halves: 16 numbers to 8, 4, 2, 1.
inline float LaneSum(const float (&lanes)[kLanes]) {
  float eight[8], four[4];
  for (int j = 0; j < 8; ++j) eight[j] = lanes[j] + lanes[j + 8];
  for (int j = 0; j < 4; ++j) four[j] = eight[j] + eight[j + 4];
  return (four[0] + four[2]) + (four[1] + four[3]);
}

inline float Sum(const float* __restrict x, std::int64_t n) {
  float lanes[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) lanes[j] += x[i + j];
  }
  for (; i < n; ++i) lanes[0] += x[i];
  return LaneSum(lanes);
}

}  // namespace slalom::nn
