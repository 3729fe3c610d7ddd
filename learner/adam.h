#pragma once

#include <ATen/core/Tensor.h>

#include <span>
#include <string>

#include "policy/nn/safetensors.h"

/// Shapes: `P` parameters of one or several networks.

namespace slalom::learner {

/// An exponential moving average of the parameters: values += rate * (parameters - values). With
/// rate = tau it is a target network's parameters; the averaged actor is kept the same way.
struct PolyakAverage {
  at::Tensor values;  ///< [P]
  double rate = 0.0;  ///< In [0, 1].
};

/// Adam (Kingma and Ba 2015, algorithm 1) with LibTorch's defaults: beta 0.9 and 0.999, epsilon
/// 1e-8.
///
/// A step and the averages after it are one pass over memory. Thread-compatible.
class Adam {
 public:
  /// `parameters`, `gradient`: [P], shared with the networks that view them.
  Adam(at::Tensor parameters, at::Tensor gradient);

  /// Takes one step down the gradient, then updates the averages. Adds the gradient's norm to
  /// `norm_total`, a float64 tensor with one element.
  void Step(double learning_rate, std::span<const PolyakAverage> averages, at::Tensor& norm_total);

  void SaveState(const std::string& prefix, nn::TensorMap& tensors) const;
  void LoadState(const std::string& prefix, const nn::TensorFile& file);

 private:
  at::Tensor parameters_;
  at::Tensor gradient_;
  at::Tensor first_moment_;   // [P], m in the paper
  at::Tensor second_moment_;  // [P], v in the paper
  std::int64_t num_steps_ = 0;
};

}  // namespace slalom::learner
