#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <limits>

#include "base/random.h"

/// Shapes: `B` batch, `W` numbers per sample.

namespace slalom::learner {

/// Normal random numbers for a batch. They are drawn on the CPU, so that every device gets the
/// same. Thread-compatible.
class Noise {
 public:
  Noise(std::int64_t batch, std::int64_t width, at::Device device);

  /// Draws clip(N(0, standard_deviation), -limit, limit). Returns [B, W] on the networks' device,
  /// overwritten by the next call.
  at::Tensor& Draw(base::Random& random, double standard_deviation = 1.0,
                   double limit = std::numeric_limits<double>::infinity());

 private:
  at::Tensor host_;
  at::Tensor values_;  // The same tensor if the device is the CPU.
};

}  // namespace slalom::learner
