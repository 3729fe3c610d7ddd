#pragma once

#include <ATen/core/Tensor.h>

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "policy/safetensors.h"

namespace slalom::learner {

/// Of a transition model: means over its updates since the last reading. NaN: there is none,
/// nothing was held out, or the kind of model has no such figure.
struct ModelStats {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::int64_t num_updates = 0;  ///< Of every member.
  double loss = kNone;           ///< All parts, of one member, on what is learned from.
  double gradient_norm = kNone;
  double held_out_rmse = kNone;         ///< Root of the mean squared error of a number of a frame.
  double held_out_change = kNone;       ///< The same of a model that says: nothing changes.
  double held_out_likelihood = kNone;   ///< Negative log-likelihood per number; probabilistic.
  double held_out_reward_rmse = kNone;  ///< Scaled as the rewards.
  double held_out_termination = kNone;  ///< Cross-entropy, [nats].
  double inside_50 = kNone;  ///< Calibration: part of held-out numbers in the middle 50 %, 90 % of
  double inside_90 = kNone;  ///< what was predicted; probabilistic.
};

/// Means over the updates since the last reading. NaN: the method has no such figure.
struct LearnerStats {
  std::int64_t num_updates = 0;  ///< Critic updates that the means are over.
  double critic_loss = 0.0;      ///< Mean squared error, of one critic.
  double q_mean = 0.0;           ///< Of the critics on the batch, scaled as the rewards.
  double critic_gradient_norm = 0.0;
  double actor_q_mean = 0.0;  ///< Q_1(s, pi(s)): what the actor climbs.
  double actor_gradient_norm = 0.0;

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double entropy = kNone;      ///< Of the policy, [nats] (SAC).
  double temperature = kNone;  ///< alpha, as it is (SAC).
  double cost_q_mean = kNone;  ///< Of the cost critics on the batch, [discounted collisions].
  double cost_critic_loss = kNone;
  double multiplier = kNone;  ///< lambda, as it is.
  double violation = kNone;   ///< Collisions per episode above the limit, at the last look.
  ModelStats model;
};

/// Totals that updates add to.
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

/// Sums of figures since the last reading, kept where the networks compute, so that an update never
/// waits for a GPU. Thread-compatible.
class Totals {
 public:
  explicit Totals(at::Device device);

  /// The sum of one figure: a view, float64, [1].
  at::Tensor& operator[](Total total) { return views_[static_cast<std::size_t>(total)]; }

  void CountUpdate() { ++num_updates_; }
  void CountActorUpdate() { ++num_actor_updates_; }
  std::int64_t num_updates() const { return num_updates_; }              ///< Since the beginning.
  std::int64_t num_actor_updates() const { return num_actor_updates_; }  ///< Since the beginning.

  /// The means, and new sums. Waits for the device.
  LearnerStats Read(int num_critics, int num_cost_critics);

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

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
