#pragma once

#include <ATen/core/Tensor.h>

#include <span>
#include <string>

#include "policy/safetensors.h"

/// Shapes: `P` parameters of a network or of several.

namespace slalom::learner {

/// A tensor that follows the parameters: follower += rate * (parameters - follower). A target
/// network (Polyak averaging, rate = tau) or an average of the weights.
struct Follower {
  at::Tensor values;  ///< [P]
  double rate = 0.0;  ///< In [0, 1].
};

/// Adam (Kingma and Ba 2015, algorithm 1) with LibTorch's defaults: beta 0.9 and 0.999, epsilon
/// 1e-8.
///
/// A step and what follows it are one pass over memory. Thread-compatible.
class Adam {
 public:
  /// `parameters`, `gradient`: [P], shared with the networks that view them.
  Adam(at::Tensor parameters, at::Tensor gradient);

  /// One step along the gradient, then moves the followers. Adds the gradient's norm to
  /// `norm_total`, a float64 tensor with one element.
  void Step(double learning_rate, std::span<const Follower> followers, at::Tensor& norm_total);

  void SaveState(const std::string& prefix, policy::TensorMap& tensors) const;
  void LoadState(const std::string& prefix, const policy::TensorFile& file);

 private:
  at::Tensor parameters_;
  at::Tensor gradient_;
  at::Tensor first_moment_;   // [P], m in the paper
  at::Tensor second_moment_;  // [P], v in the paper
  std::int64_t num_steps_ = 0;
};

}  // namespace slalom::learner
