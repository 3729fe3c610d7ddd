#include <cmath>

#include "policy/nn/kernels/packed_kernel.h"
#include "policy/nn/kernels/small_gemm_kernel.h"

namespace slalom::nn {
namespace {

/// Vectors of four as the compiler makes them: NEON on ARM. A processor without fused
/// multiplication gets the same bits from the standard library, slowly.
struct PortableLanes {
  typedef float V __attribute__((vector_size(16)));
  static constexpr std::int64_t kWidth = 4;
  static constexpr int kRows = 8;

  static V Zero() { return V{}; }
  static V Broadcast(float value) { return V{value, value, value, value}; }
  static V Load(const float* p) {
    V value;
    __builtin_memcpy(&value, p, sizeof(V));
    return value;
  }
  static V LoadFirst(const float* p, int n) {
    V value{};
    for (int i = 0; i < n; ++i) value[i] = p[i];
    return value;
  }
  static void Store(float* p, V value) { __builtin_memcpy(p, &value, sizeof(V)); }
  static void StoreFirst(float* p, V value, int n) {
    for (int i = 0; i < n; ++i) p[i] = value[i];
  }
  static V Add(V a, V b) { return a + b; }
  static V MultiplyAdd(V a, V b, V c) {
    return V{std::fma(a[0], b[0], c[0]), std::fma(a[1], b[1], c[1]), std::fma(a[2], b[2], c[2]),
             std::fma(a[3], b[3], c[3])};
  }
  static V KeepPositive(V value) { return value > Zero() ? value : Zero(); }
  static V KeepWhere(V mask, V value) { return mask > Zero() ? value : Zero(); }

  /// Rows become columns.
  static void Transpose(V (&rows)[4]) {
    const V old[4] = {rows[0], rows[1], rows[2], rows[3]};
    for (int i = 0; i < 4; ++i) rows[i] = V{old[0][i], old[1][i], old[2][i], old[3][i]};
  }
};

}  // namespace

const PackedKernel kPortablePackedKernel = {SmallGemmKernel<PortableLanes>::PackedColumns,
                                            SmallGemmKernel<PortableLanes>::PackWeights,
                                            SmallGemmKernel<PortableLanes>::RunPacked};

}  // namespace slalom::nn
