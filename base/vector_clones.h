#pragma once

/// In front of a hot function: compiled twice, the better one for the processor chosen at start.
/// Such a function may call nothing with a compiler's vector type as argument or result that is not
/// SLALOM_ALWAYS_INLINE (lambdas included): caller and callee would pass it in different registers.
/// Both clones give the same bits where no operation is reordered or fused, as this project's flags
/// see to. Left out under sanitizers, whose run time is not up yet when that choice is made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SLALOM_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define SLALOM_VECTOR_CLONES
#endif

#define SLALOM_ALWAYS_INLINE __attribute__((always_inline)) inline
