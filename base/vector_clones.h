#pragma once

/// Put this in front of a hot function: it is compiled twice, and the version that suits the
/// processor is chosen when the program starts.
///
/// Whatever such a function calls with a compiler's vector type as argument or result, lambdas
/// included, must be SLALOM_ALWAYS_INLINE, because caller and callee would pass it in different
/// registers. Both versions give the same bits, since this project's flags let the compiler neither
/// reorder nor fuse operations. Under sanitizers there is one version only, because their run time
/// is not ready when the choice is made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SLALOM_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define SLALOM_VECTOR_CLONES
#endif

#define SLALOM_ALWAYS_INLINE __attribute__((always_inline)) inline
