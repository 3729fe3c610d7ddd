#pragma once

#include <ATen/ATen.h>

#include <cstdint>
#include <string>

#include "base/random.h"
#include "policy/safetensors.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action.

namespace slalom::learner {

/// Normal random numbers for a batch of actions, drawn on the CPU, so that every device gets the
/// same. Thread-compatible.
class Noise {
 public:
  Noise(std::uint64_t seed, std::int64_t batch, at::Device device);

  /// New numbers, clip(N(0, standard_deviation), -limit, limit). [B, A], where the networks
  /// compute; the next call overwrites them.
  const at::Tensor& Draw(double standard_deviation, double limit);

  void SaveState(const std::string& name, policy::TensorMap& tensors) const;
  void LoadState(const std::string& name, const policy::TensorFile& file);

 private:
  base::Random random_;
  at::Tensor host_;
  at::Tensor values_;  // The same tensor where the device is the CPU.
};

}  // namespace slalom::learner
