#pragma once

#include <ATen/core/Tensor.h>

#include <array>
#include <cstdint>

#include "metrics/learning_figures.h"
#include "policy/nn/safetensors.h"

namespace slalom::learner {

/// A learner's figures of its updates since the last reading.
using LearnerStats = metrics::LearningFigures;
using ModelStats = metrics::ModelFigures;

/// The sums that updates add to. `Totals::Read` makes means of them. It divides sums of the critics
/// by the number of updates (kCriticLoss and kQ also by the number of critics), and sums of the
/// actor by the actor's updates.
enum class Total {
  kCriticLoss,  ///< Sum over the critics of their losses.
  kQ,           ///< Sum over the critics of mean Q_k(s, a); see `learner.divergence_limit`.
  kCriticNorm,  ///< Gradient norm; `Critics::Descend` adds it, and likewise for the actor.
  kActorQ,      ///< Mean Q(s, pi(s)), which the actor climbs.
  kActorNorm,
  kEntropy,   ///< -mean log pi(a|s) of a stochastic policy.
  kCostLoss,  ///< This and the next two belong to the constraint.
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

  void CountUpdate() { ++num_updates_; }             ///< Called by `Learner` before each update.
  void CountActorUpdate() { ++num_actor_updates_; }  ///< Called by the algorithm.
  std::int64_t num_updates() const { return num_updates_; }              ///< Since the beginning.
  std::int64_t num_actor_updates() const { return num_actor_updates_; }  ///< Since the beginning.

  /// Whether there were updates since the last reading.
  bool has_new() const { return num_updates_ > updates_at_reading_; }

  /// Returns the means, NaN if there was no update, and resets the sums. Waits for the device.
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
