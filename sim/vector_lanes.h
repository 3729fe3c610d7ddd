#pragma once

#include <cstring>

#include "base/vector_clones.h"

/// Arithmetic on eight numbers at once. It uses the compiler's vector type, so that debug, release,
/// SSE2 and AVX2 builds do the same IEEE operations on the same elements and give the same bits.
/// Use it only in `.cc` files compiled with -fno-math-errno (sim/simulator.cmake).

namespace slalom::sim {

inline constexpr int kLanes = 8;

using Floats = float __attribute__((vector_size(4 * kLanes)));
using Ints = int __attribute__((vector_size(4 * kLanes)));

SLALOM_ALWAYS_INLINE Floats Load(const float* from) {
  Floats v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
SLALOM_ALWAYS_INLINE void Store(float* to, Floats v) { std::memcpy(to, &v, sizeof v); }
SLALOM_ALWAYS_INLINE void Store(int* to, Ints v) { std::memcpy(to, &v, sizeof v); }
SLALOM_ALWAYS_INLINE Floats Fill(float x) { return Floats{} + x; }
SLALOM_ALWAYS_INLINE Floats Min(Floats a, Floats b) { return a < b ? a : b; }
SLALOM_ALWAYS_INLINE Floats Max(Floats a, Floats b) { return a > b ? a : b; }
SLALOM_ALWAYS_INLINE Floats Abs(Floats a) { return Max(a, -a); }
SLALOM_ALWAYS_INLINE Floats Sqrt(Floats a) {
  Floats root;
  for (int k = 0; k < kLanes; ++k) root[k] = __builtin_sqrtf(a[k]);
  return root;
}
/// Truncates towards zero.
SLALOM_ALWAYS_INLINE Ints ToInts(Floats a) { return __builtin_convertvector(a, Ints); }
SLALOM_ALWAYS_INLINE Floats ToFloats(Ints a) { return __builtin_convertvector(a, Floats); }

}  // namespace slalom::sim
