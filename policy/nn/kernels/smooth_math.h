#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "base/vector_clones.h"

/// The exponential and functions made of it, in float32, in a form that compilers vectorise in
/// loops. The standard library's need a call for each number. Pure functions.

namespace slalom::nn {

/// e^x with a relative error below 3e-7; x is clipped to [-87, 88].
SLALOM_ALWAYS_INLINE float SmoothExp(float x) {
  const float low = x < -87.0f ? -87.0f : x;
  const float bounded = low > 88.0f ? 88.0f : low;
  // x = n ln 2 + r with |r| <= ln(2) / 2, then e^r by its Taylor polynomial, whose next term is
  // below 6e-9.
  const float n = std::floor(bounded * 1.44269504f + 0.5f);
  const float r = (bounded - n * 0.693359375f) - n * -2.12194440e-4f;
  float sum = 1.0f / 5040.0f;
  sum = sum * r + 1.0f / 720.0f;
  sum = sum * r + 1.0f / 120.0f;
  sum = sum * r + 1.0f / 24.0f;
  sum = sum * r + 1.0f / 6.0f;
  sum = sum * r + 0.5f;
  sum = sum * r + 1.0f;
  sum = sum * r + 1.0f;
  return sum * std::bit_cast<float>((static_cast<std::int32_t>(n) + 127) << 23);
}

/// tanh x, absolute error below 3e-7.
SLALOM_ALWAYS_INLINE float SmoothTanh(float x) {
  const float bounded = x < -20.0f ? -20.0f : (x > 20.0f ? 20.0f : x);
  return 1.0f - 2.0f / (SmoothExp(2.0f * bounded) + 1.0f);
}

/// 1 / (1 + e^-x), absolute error below 3e-7.
SLALOM_ALWAYS_INLINE float SmoothSigmoid(float x) { return 1.0f / (1.0f + SmoothExp(-x)); }

/// ln(1 + e^x), without overflow.
inline double Softplus(double x) {
  return x > 0.0 ? x + std::log1p(std::exp(-x)) : std::log1p(std::exp(x));
}

}  // namespace slalom::nn
