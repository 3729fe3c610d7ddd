#pragma once

#include <ATen/core/Tensor.h>

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "nn/safetensors.h"

namespace slalom::learner {

/// Statistics of a transition model: means over its updates since the last reading. A value is NaN
/// if there is no model, nothing was held out, or this kind of model has no such statistic.
struct ModelStats {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::int64_t num_updates = 0;  ///< Updates of each ensemble member.
  double loss = kNone;           ///< Training loss, mean over the members.
  double gradient_norm = kNone;
  double held_out_rmse = kNone;        ///< Root mean squared error per predicted feature.
  double held_out_change = kNone;      ///< The same for predicting that nothing changes.
  double held_out_likelihood = kNone;  ///< Negative log-likelihood per feature; probabilistic only.
  double held_out_reward_rmse = kNone;  ///< In units of the scaled reward.
  double held_out_termination = kNone;  ///< Cross-entropy, [nats].
  /// Calibration of probabilistic models: the fraction of held-out features that lie in the middle
  /// 50 % and 90 % of the predicted distribution.
  double inside_50 = kNone;
  double inside_90 = kNone;
};

/// Statistics of the updates since the last reading: means, unless said otherwise. A value is NaN
/// if the method has no such statistic.
struct LearnerStats {
  std::int64_t num_updates = 0;  ///< Critic updates that the means are taken over.
  double critic_loss = 0.0;      ///< Mean squared TD error per critic.
  double q_mean = 0.0;           ///< Mean action value on the batch, in units of the scaled reward.
  double critic_gradient_norm = 0.0;
  double actor_q_mean = 0.0;  ///< The value that the actor maximises, such as Q_1(s, pi(s)).
  double actor_gradient_norm = 0.0;

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double entropy = kNone;      ///< Entropy of the policy, [nats] (SAC).
  double temperature = kNone;  ///< alpha now, not a mean (SAC).
  double cost_q_mean = kNone;  ///< Mean cost value on the batch, [discounted collisions].
  double cost_critic_loss = kNone;
  double multiplier = kNone;  ///< lambda now, not a mean.
  double violation = kNone;   ///< Collisions per episode above the limit, when last observed.
  ModelStats model;
};

/// The sums that updates add to.
enum class Total {
  kCriticLoss,
  kQ,
  kCriticNorm,
  kActorQ,
  kActorNorm,
  kEntropy,
  kCostLoss,
  kCostQ,
  kCostNorm,
  kCount
};

/// Sums of the statistics since the last reading. They are kept on the device of the networks, so
/// that an update never waits for a GPU. Thread-compatible.
class Totals {
 public:
  explicit Totals(at::Device device);

  /// Returns one sum: a view, float64, [1].
  at::Tensor& operator[](Total total) { return views_[static_cast<std::size_t>(total)]; }

  void CountUpdate() { ++num_updates_; }
  void CountActorUpdate() { ++num_actor_updates_; }
  std::int64_t num_updates() const { return num_updates_; }              ///< Since the beginning.
  std::int64_t num_actor_updates() const { return num_actor_updates_; }  ///< Since the beginning.

  /// Returns the means and resets the sums. Waits for the device.
  LearnerStats Read(int num_critics, int num_cost_critics);

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  static constexpr auto kNumTotals = static_cast<std::size_t>(Total::kCount);

  at::Tensor sums_;  // [kNumTotals] float64
  std::array<at::Tensor, kNumTotals> views_;
  std::int64_t num_updates_ = 0;
  std::int64_t num_actor_updates_ = 0;
  std::int64_t updates_at_reading_ = 0;
  std::int64_t actor_updates_at_reading_ = 0;
};

}  // namespace slalom::learner
