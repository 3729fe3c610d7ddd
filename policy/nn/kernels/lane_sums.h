#pragma once

#include <cstdint>

#include "base/vector_clones.h"

/// Sums that vectorise and yet give the same number on every processor, for the kernels of
/// policy/nn/kernels/forward_kernels.cc and of the gradients beside it.

namespace slalom::nn {

/// Number of partial sums side by side, so that sums vectorise in an order that is always the same.
inline constexpr int kLanes = 16;

/// Sums by halves: 16 numbers to 8, 4, 2, 1.
SLALOM_ALWAYS_INLINE float LaneSum(const float (&lanes)[kLanes]) {
  float eight[8], four[4];
  for (int j = 0; j < 8; ++j) eight[j] = lanes[j] + lanes[j + 8];
  for (int j = 0; j < 4; ++j) four[j] = eight[j] + eight[j + 4];
  return (four[0] + four[2]) + (four[1] + four[3]);
}

SLALOM_ALWAYS_INLINE float Sum(const float* __restrict x, std::int64_t n) {
  float lanes[kLanes] = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (int j = 0; j < kLanes; ++j) lanes[j] += x[i + j];
  }
  for (; i < n; ++i) lanes[0] += x[i];
  return LaneSum(lanes);
}

constexpr int kDotLanes = 8;

/// Scalar product in eight partial sums, because heads of attention are narrow.
SLALOM_ALWAYS_INLINE float Dot(const float* __restrict x, const float* __restrict y,
                               std::int64_t n) {
  float lanes[kDotLanes] = {};
  std::int64_t i = 0;
  for (; i + kDotLanes <= n; i += kDotLanes) {
    for (int j = 0; j < kDotLanes; ++j) lanes[j] += x[i + j] * y[i + j];
  }
  for (; i < n; ++i) lanes[0] += x[i] * y[i];
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) +
         ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

/// y += scale * x.
SLALOM_ALWAYS_INLINE void AddScaled(float scale, const float* __restrict x, std::int64_t n,
                                    float* __restrict y) {
  for (std::int64_t j = 0; j < n; ++j) y[j] += scale * x[j];
}

}  // namespace slalom::nn
