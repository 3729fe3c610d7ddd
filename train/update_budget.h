#pragma once

#include <cstdint>

#include "base/check.h"

namespace slalom::train {

/// Counts the updates that environment steps have paid for, so that a run in one process holds a
/// fixed ratio of updates to steps. (Between processes `replay::RateLimiter` holds it.) A value;
/// thread-compatible.
class UpdateBudget {
 public:
  /// `learning_starts`: steps before which no update is due, and which earn none.
  /// Requires: updates_per_step > 0, learning_starts >= 0.
  UpdateBudget(double updates_per_step, std::int64_t learning_starts)
      : updates_per_step_(updates_per_step), learning_starts_(learning_starts) {
    SLALOM_CHECK_GT(updates_per_step, 0.0);
    SLALOM_CHECK_GE(learning_starts, 0);
  }

  void AddSteps(std::int64_t n) { steps_ += n; }
  void AddUpdate() { ++updates_; }

  /// An update is due: the next one keeps updates <= ratio * (steps - learning_starts).
  bool update_due() const {
    const auto counted = static_cast<double>(steps_ - learning_starts_);
    return static_cast<double>(updates_ + 1) <= counted * updates_per_step_;
  }

  std::int64_t steps() const { return steps_; }
  std::int64_t updates() const { return updates_; }
  void Restore(std::int64_t steps, std::int64_t updates) {
    steps_ = steps;
    updates_ = updates;
  }

 private:
  double updates_per_step_;
  std::int64_t learning_starts_;
  std::int64_t steps_ = 0;
  std::int64_t updates_ = 0;
};

}  // namespace slalom::train
