#include <immintrin.h>

#include "policy/nn/kernels/packed_kernel.h"
#include "policy/nn/kernels/small_gemm_kernel.h"

namespace slalom::nn {
namespace {

struct Avx512Lanes {
  using V = __m512;
  static constexpr std::int64_t kWidth = 16;
  static constexpr int kRows = 8;

  static V Zero() { return _mm512_setzero_ps(); }
  static V Broadcast(float value) { return _mm512_set1_ps(value); }
  static V Load(const float* p) { return _mm512_loadu_ps(p); }
  static V LoadFirst(const float* p, int n) { return _mm512_maskz_loadu_ps(First(n), p); }
  static void Store(float* p, V value) { _mm512_storeu_ps(p, value); }
  static void StoreFirst(float* p, V value, int n) { _mm512_mask_storeu_ps(p, First(n), value); }
  static V Add(V a, V b) { return _mm512_add_ps(a, b); }
  static V MultiplyAdd(V a, V b, V c) { return _mm512_fmadd_ps(a, b, c); }
  static V KeepPositive(V value) { return _mm512_max_ps(value, Zero()); }
  static V KeepWhere(V mask, V value) {
    return _mm512_maskz_mov_ps(_mm512_cmp_ps_mask(mask, Zero(), _CMP_GT_OQ), value);
  }

  /// Rows become columns.
  static void Transpose(V (&rows)[16]) {
    V pairs[16], fours[16];
#pragma GCC unroll 8
    for (int i = 0; i < 16; i += 2) {
      pairs[i] = _mm512_unpacklo_ps(rows[i], rows[i + 1]);
      pairs[i + 1] = _mm512_unpackhi_ps(rows[i], rows[i + 1]);
    }
#pragma GCC unroll 4
    for (int i = 0; i < 16; i += 4) {
      fours[i] = Interleave<false>(pairs[i], pairs[i + 2]);
      fours[i + 1] = Interleave<true>(pairs[i], pairs[i + 2]);
      fours[i + 2] = Interleave<false>(pairs[i + 1], pairs[i + 3]);
      fours[i + 3] = Interleave<true>(pairs[i + 1], pairs[i + 3]);
    }
    // fours[4 q + c] holds columns c, c + 4, c + 8, c + 12 of the rows 4 q .. 4 q + 3.
#pragma GCC unroll 4
    for (int c = 0; c < 4; ++c) {
      const V low01 = _mm512_shuffle_f32x4(fours[c], fours[4 + c], 0x88);
      const V high01 = _mm512_shuffle_f32x4(fours[c], fours[4 + c], 0xdd);
      const V low23 = _mm512_shuffle_f32x4(fours[8 + c], fours[12 + c], 0x88);
      const V high23 = _mm512_shuffle_f32x4(fours[8 + c], fours[12 + c], 0xdd);
      rows[c] = _mm512_shuffle_f32x4(low01, low23, 0x88);
      rows[c + 8] = _mm512_shuffle_f32x4(low01, low23, 0xdd);
      rows[c + 4] = _mm512_shuffle_f32x4(high01, high23, 0x88);
      rows[c + 12] = _mm512_shuffle_f32x4(high01, high23, 0xdd);
    }
  }

 private:
  static __mmask16 First(int n) { return static_cast<__mmask16>((1u << n) - 1u); }

  template <bool kHigh>
  static V Interleave(V a, V b) {
    const __m512d x = _mm512_castps_pd(a), y = _mm512_castps_pd(b);
    return _mm512_castpd_ps(kHigh ? _mm512_unpackhi_pd(x, y) : _mm512_unpacklo_pd(x, y));
  }
};

}  // namespace

void SmallGemmAvx512(const GemmTask& task, float* scratch) {
  SmallGemmKernel<Avx512Lanes>::Run(task, scratch);
}

const PackedKernel kAvx512PackedKernel = {SmallGemmKernel<Avx512Lanes>::PackedColumns,
                                          SmallGemmKernel<Avx512Lanes>::PackWeights,
                                          SmallGemmKernel<Avx512Lanes>::RunPacked};

}  // namespace slalom::nn
