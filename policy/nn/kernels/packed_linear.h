#pragma once

#include <cstdint>
#include <vector>

#include "policy/nn/kernels/cpu_features.h"
#include "policy/nn/kernels/packed_kernel.h"
#include "policy/nn/kernels/rows.h"

namespace slalom::nn {

/// A fully connected layer for many forward passes with the same weights. Setting the weights
/// brings them into the order in which the product reads them, so that a pass need not.
///
/// Gives the bits of `SmallGemm`, at any depth: they depend neither on the processor nor on the
/// other rows. `Forward` is thread-safe and allocates nothing.
///
/// Shapes: `N` rows, `I` inputs, `O` outputs.
class PackedLinear {
 public:
  /// All weights are 0 until they are set.
  PackedLinear(std::int64_t inputs, std::int64_t outputs,
               const CpuFeatures& cpu = DetectCpuFeatures());

  /// `weight`: [O, I], dense; `bias`: [O]. Both are copied. Allocates nothing.
  void SetWeights(const float* weight, const float* bias);

  /// y = x w^T + b, then ReLU if `relu`. x: [N, I]; y: [N, O].
  void Forward(std::int64_t rows, Rows x, bool relu, Rows y) const {
    ForwardPart(rows, x, 0, inputs_, relu, y);
  }

  /// Computes `Forward` as if all inputs but `count` from `first` on were 0. x: [N, count], those
  /// inputs. Requires:
  /// 0 <= first, first + count <= inputs().
  void ForwardPart(std::int64_t rows, Rows x, std::int64_t first, std::int64_t count, bool relu,
                   Rows y) const;

  std::int64_t inputs() const { return inputs_; }
  std::int64_t outputs() const { return outputs_; }

 private:
  /// Keeps vectors of a panel from crossing lines of the cache.
  struct alignas(64) CacheLine {
    float numbers[16] = {};
  };

  std::int64_t inputs_;
  std::int64_t outputs_;
  const PackedKernel* kernel_;
  std::vector<CacheLine> panels_;
  std::vector<float> bias_;
};

}  // namespace slalom::nn
