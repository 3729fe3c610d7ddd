#pragma once

#include <ATen/core/Tensor.h>

#include <span>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "policy/nn/safetensors.h"

/// Shapes: `P` parameters of one or several networks, `S` gradients.

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
  /// `parameters`: [P]; `gradients`: [P], or [S, P] for a sum of S gradients. Both are shared with
  /// the networks that view them. `parallel` splits a step by parameters; null: one thread takes
  /// it. The results are the same bits.
  Adam(at::Tensor parameters, const at::Tensor& gradients, base::ParallelFor* parallel = nullptr);

  /// Adds the gradients up in the first of them, in their order: the first `num_gradients`. Takes
  /// one step down the sum, then updates the averages. Adds the norm of the sum to `norm_total`, a
  /// float64 tensor with one element. Allocates nothing on the CPU.
  void Step(double learning_rate, std::span<const PolyakAverage> averages, at::Tensor& norm_total,
            int num_gradients = 1);

  void SaveState(const std::string& prefix, nn::TensorMap& tensors) const;
  void LoadState(const std::string& prefix, const nn::TensorFile& file);

 private:
  at::Tensor parameters_;
  std::vector<at::Tensor> gradients_;  // [S], views [P]
  at::Tensor first_moment_;            // [P], m in the paper
  at::Tensor second_moment_;           // [P], v in the paper
  base::ParallelFor* parallel_;
  std::vector<double> squared_norms_;  // Of each block of the gradient.
  std::int64_t num_steps_ = 0;
};

}  // namespace slalom::learner
