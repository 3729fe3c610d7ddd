#include <immintrin.h>

#include "policy/nn/kernels/packed_kernel.h"
#include "policy/nn/kernels/small_gemm_kernel.h"

namespace slalom::nn {
namespace {

struct Avx2Lanes {
  using V = __m256;
  static constexpr std::int64_t kWidth = 8;
  static constexpr int kRows = 6;

  static V Zero() { return _mm256_setzero_ps(); }
  static V Broadcast(float value) { return _mm256_set1_ps(value); }
  static V Load(const float* p) { return _mm256_loadu_ps(p); }
  static V LoadFirst(const float* p, int n) { return _mm256_maskload_ps(p, First(n)); }
  static void Store(float* p, V value) { _mm256_storeu_ps(p, value); }
  static void StoreFirst(float* p, V value, int n) { _mm256_maskstore_ps(p, First(n), value); }
  static V Add(V a, V b) { return _mm256_add_ps(a, b); }
  static V MultiplyAdd(V a, V b, V c) { return _mm256_fmadd_ps(a, b, c); }
  static V KeepPositive(V value) { return _mm256_max_ps(value, Zero()); }
  static V KeepWhere(V mask, V value) {
    return _mm256_and_ps(_mm256_cmp_ps(mask, Zero(), _CMP_GT_OQ), value);
  }

  /// Rows become columns.
  static void Transpose(V (&rows)[8]) {
    V pairs[8], fours[8];
#pragma GCC unroll 4
    for (int i = 0; i < 8; i += 2) {
      pairs[i] = _mm256_unpacklo_ps(rows[i], rows[i + 1]);
      pairs[i + 1] = _mm256_unpackhi_ps(rows[i], rows[i + 1]);
    }
#pragma GCC unroll 2
    for (int i = 0; i < 8; i += 4) {
      fours[i] = _mm256_shuffle_ps(pairs[i], pairs[i + 2], 0x44);
      fours[i + 1] = _mm256_shuffle_ps(pairs[i], pairs[i + 2], 0xee);
      fours[i + 2] = _mm256_shuffle_ps(pairs[i + 1], pairs[i + 3], 0x44);
      fours[i + 3] = _mm256_shuffle_ps(pairs[i + 1], pairs[i + 3], 0xee);
    }
    // fours[4 q + c] holds columns c and c + 4 of the rows 4 q .. 4 q + 3.
#pragma GCC unroll 4
    for (int c = 0; c < 4; ++c) {
      rows[c] = _mm256_permute2f128_ps(fours[c], fours[4 + c], 0x20);
      rows[c + 4] = _mm256_permute2f128_ps(fours[c], fours[4 + c], 0x31);
    }
  }

 private:
  static __m256i First(int n) {
    return _mm256_cmpgt_epi32(_mm256_set1_epi32(n), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
  }
};

}  // namespace

void SmallGemmAvx2(const GemmTask& task, float* scratch) {
  SmallGemmKernel<Avx2Lanes>::Run(task, scratch);
}

const PackedKernel kAvx2PackedKernel = {SmallGemmKernel<Avx2Lanes>::PackedColumns,
                                        SmallGemmKernel<Avx2Lanes>::PackWeights,
                                        SmallGemmKernel<Avx2Lanes>::RunPacked};

}  // namespace slalom::nn
