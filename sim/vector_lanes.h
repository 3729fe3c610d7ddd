#pragma once

#include <cstring>

/// Eight numbers worked on together, written with the compiler's vector type, so that debug,
/// release, SSE2 and AVX2 builds do the same IEEE operations on the same elements and give the same
/// bits. For use inside `.cc` files compiled with -fno-math-errno (see simulator.cmake).

/// In front of a hot function: compiled twice, the better one for the processor chosen at start.
/// Such a function may call nothing with a `Floats` or `Ints` argument or result that is not
/// SLALOM_ALWAYS_INLINE (lambdas included): caller and callee would pass it in different registers.
/// Left out under sanitizers, whose run time is not up yet when that choice is made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SLALOM_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define SLALOM_VECTOR_CLONES
#endif

#define SLALOM_ALWAYS_INLINE __attribute__((always_inline)) inline

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
