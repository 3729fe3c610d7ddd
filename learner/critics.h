#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/minibatch.h"
#include "learner/value_ops.h"
#include "policy/network.h"

/// Shapes: `B` batch, `A` = 2 numbers of an action, `K` critics, `P` parameters of one.

namespace slalom::learner {

/// K action-value networks Q_k with nothing shared, and a target network for each.
/// Thread-compatible.
///
/// All parameters lie in one tensor [K * P], those of the targets in another.
class Critics {
 public:
  /// Targets start as copies. The passes are bound to `minibatch`, which must outlive this. The
  /// names of what is saved begin with `name`.
  Critics(std::string name, const policy::NetworkShape& shape, int num_critics,
          base::Random& random, const Minibatch& minibatch);

  /// y = reward + discount * min_k (or max_k) Q'_k(s', a'), with a' from the minibatch's next
  /// input. All [B].
  void ComputeTdTarget(const at::Tensor& reward, const at::Tensor& discount,
                       TargetReduction reduction, at::Tensor& y);

  /// Of samples drawn by priority.
  struct Importance {
    const at::Tensor& weight;  ///< [B]
    at::Tensor& td_error;      ///< [B]
  };

  /// One step of Adam on sum_k mean (Q_k(s, a) - y)^2, with the targets following at `polyak_rate`
  /// (0: not). Adds loss, mean Q and gradient norm to their totals (float64 tensors with one
  /// element). With `importance`, each sample's gradient counts by its weight, and `error` [B]
  /// becomes the mean over the critics of |Q_k(s, a) - y|.
  void GradientStep(const at::Tensor& y, double learning_rate, double polyak_rate,
                    at::Tensor& loss_total, at::Tensor& value_total, at::Tensor& norm_total,
                    const Importance* importance = nullptr);

  /// Gradient by the action of -mean Q_1(s, a), with a from the minibatch's input. Returns [B, A],
  /// overwritten by the next call. Adds mean Q_1 to `value_total`, unless null.
  at::Tensor& ActionGradient(at::Tensor* value_total);

  /// The same of -mean min_k Q_k(s, a).
  at::Tensor& MinActionGradient(at::Tensor& value_total);

  int size() const { return static_cast<int>(critics_.size()); }
  const at::Tensor& parameters() const { return parameters_; }                ///< [K * P]
  const at::Tensor& target_parameters() const { return target_parameters_; }  ///< [K * P]

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

 private:
  struct Critic {
    policy::Network network;
    policy::Network target;
    policy::Network gradient;
    policy::NetworkPass pass;
    policy::NetworkPass target_pass;
  };

  const std::string name_;
  at::Tensor parameters_;
  at::Tensor target_parameters_;
  at::Tensor gradient_;
  Adam adam_;
  std::vector<Critic> critics_;
  std::vector<at::Tensor> target_values_;  // [B, 1] each, the outputs of the target passes
  std::vector<at::Tensor> values_;         // [B, 1] each, of the passes
  std::vector<at::Tensor> value_gradients_;
};

}  // namespace slalom::learner
