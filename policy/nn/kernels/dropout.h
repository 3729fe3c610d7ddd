#pragma once

#include <ATen/core/Tensor.h>

#include "base/random.h"

namespace slalom::nn {

/// Dropout of one tensor (Srivastava et al. 2014): each number becomes 0 with the rate's
/// probability or else grows by 1 / (1 - rate), forward and backward alike. Allocates on
/// construction only.
class Dropout {
 public:
  Dropout() = default;  ///< No dropout: every call does nothing.

  /// For tensors of `like`'s shape. Requires: 0 < rate < 1.
  Dropout(double rate, const at::Tensor& like, base::Random* random);

  /// Draws a new mask.
  void Draw();
  /// y *= mask. y: of `like`'s shape, dense.
  void Apply(at::Tensor& y) const;

  /// Undefined if there is no dropout.
  const at::Tensor& mask() const { return mask_; }

 private:
  double rate_ = 0.0;
  base::Random* random_ = nullptr;
  at::Tensor mask_;
  at::Tensor host_mask_;  // float32; mask_ itself if that is float32 in host memory
};

}  // namespace slalom::nn
