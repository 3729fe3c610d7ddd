#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/minibatch.h"
#include "learner/value_ops.h"
#include "nn/network.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action, `K` critics, `P` parameters of one.

namespace slalom::learner {

/// K independent action-value networks Q_k and a target network for each. Thread-compatible.
///
/// The parameters of all K networks are one tensor [K * P]; those of the target networks another.
class Critics {
 public:
  /// The target networks start as copies. Keeps a reference to `minibatch`, which must outlive the
  /// critics. Saved tensors get names that begin with `name`.
  Critics(std::string name, const nn::NetworkShape& shape, int num_critics, base::Random& random,
          const Minibatch& minibatch);

  /// Computes the TD target y = reward + discount * min_k (or max_k) Q'_k(s', a') with the target
  /// networks, a' being the action in the minibatch's next input. All [B].
  void ComputeTdTarget(const at::Tensor& reward, const at::Tensor& discount,
                       TargetReduction reduction, at::Tensor& y);

  /// Needed for samples that were drawn by priority.
  struct Importance {
    const at::Tensor& weight;  ///< [B], input: importance weights
    at::Tensor& td_error;      ///< [B], output: mean over the critics of |Q_k(s, a) - y|
  };

  /// Takes one step of Adam on sum_k mean (Q_k(s, a) - y)^2, then updates the target networks at
  /// `polyak_rate` (0: they stay). Adds loss, mean Q and gradient norm to their totals (float64
  /// tensors with one element). With `importance`, each sample's gradient is multiplied by its
  /// weight, and the TD errors are written.
  void GradientStep(const at::Tensor& y, double learning_rate, double polyak_rate,
                    at::Tensor& loss_total, at::Tensor& value_total, at::Tensor& norm_total,
                    const Importance* importance = nullptr);

  /// Returns the gradient of -mean Q_1(s, a) with respect to the actions in the minibatch's input,
  /// [B, A]. The next call overwrites it. Adds mean Q_1 to `value_total`, unless null.
  at::Tensor& ActionGradient(at::Tensor* value_total);

  /// As `ActionGradient`, for -mean min_k Q_k(s, a).
  at::Tensor& MinActionGradient(at::Tensor& value_total);

  int size() const { return static_cast<int>(critics_.size()); }
  const at::Tensor& parameters() const { return parameters_; }                ///< [K * P]
  const at::Tensor& target_parameters() const { return target_parameters_; }  ///< [K * P]

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  struct Critic {
    nn::Network network;
    nn::Network target;
    nn::Network gradient;
    nn::NetworkPass pass;
    nn::NetworkPass target_pass;
  };

  const std::string name_;
  at::Tensor parameters_;
  at::Tensor target_parameters_;
  at::Tensor gradient_;
  Adam adam_;
  std::vector<Critic> critics_;
  std::vector<at::Tensor> target_values_;  // [B, 1] each, outputs of the target networks
  std::vector<at::Tensor> values_;         // [B, 1] each, outputs of the networks
  std::vector<at::Tensor> value_gradients_;
};

}  // namespace slalom::learner
