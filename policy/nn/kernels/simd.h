#pragma once

/// `SLALOM_SIMD` before a function compiles it for x86-64-v4 (AVX-512), for x86-64-v3 (AVX2) and
/// for the baseline, and picks one when the program starts. Use it for elementwise loops only:
/// without contraction and reordered sums, all versions give the same numbers. It does nothing if
/// the whole program is compiled for such a processor (SLALOM_NATIVE).
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SLALOM_SIMD __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define SLALOM_SIMD
#endif
