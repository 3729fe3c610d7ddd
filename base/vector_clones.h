#pragma once

/// `SLALOM_VECTOR_CLONES` in front of a hot function: it is compiled twice, for x86-64-v3 (AVX2)
/// and for the baseline, and the version that suits the processor is chosen when the program
/// starts. With `SLALOM_SIMD` it is compiled for x86-64-v4 (AVX-512), too, which pays in
/// elementwise loops.
///
/// Whatever such a function calls with a compiler's vector type as argument or result, lambdas
/// included, must be SLALOM_ALWAYS_INLINE, because caller and callee would pass it in different
/// registers. All versions give the same bits, since this project's flags let the compiler neither
/// reorder nor fuse operations. There is one version only under sanitizers, whose run time is
/// not ready when the choice is made, and if the whole program is compiled for such a processor
/// (SLALOM_NATIVE).
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#if __GNUC__ >= 12
#define SLALOM_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#define SLALOM_SIMD __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else  // It chooses by features, and knows no levels.
#define SLALOM_VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#define SLALOM_SIMD __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
#else
#define SLALOM_VECTOR_CLONES
#define SLALOM_SIMD
#endif

#define SLALOM_ALWAYS_INLINE __attribute__((always_inline)) inline
