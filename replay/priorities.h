#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"

namespace slalom::replay {

/// The weights by which a prioritized table draws rows, one per slot of its ring: a sum tree with
/// eight children per node, so that a node is one cache line.
///
/// The weight of a slot is p^alpha for the priority p of its row, or 0 if there is nothing to draw.
/// Priorities are clipped to [kSmallest, kLargest], so that no row is excluded by a priority of 0
/// or outweighs all others. Thread-compatible. Memory: about 9.2 bytes per slot. Source: Schaul et
/// al. 2016, proportional variant.
class Priorities {
 public:
  static constexpr double kSmallest = 1e-6;
  static constexpr double kLargest = 1e6;

  /// Starts with all weights 0. Requires: num_slots >= 1, 0 <= alpha <= 1.
  Priorities(std::int64_t num_slots, double alpha);

  /// Sets a row's priority; NaN counts as `kLargest`. Requires: `slot` in [0, num_slots). Cost: one
  /// path of the tree.
  void Set(std::int64_t slot, double priority);
  /// Gives a new row the largest priority that was ever `Set`, or 1 if none was.
  void SetNew(std::int64_t slot) { SetWeight(slot, new_weight_); }
  /// Restores a row's weight. Requires: 0 < weight <= kLargest.
  void RestoreWeight(std::int64_t slot, double weight) { SetWeight(slot, weight); }
  /// Raises `largest()` to at least this value. Requires: largest <= kLargest.
  void RaiseLargest(double largest);
  double largest() const { return largest_; }
  /// Makes a slot's weight 0.
  void Clear(std::int64_t slot) { SetWeight(slot, 0.0); }

  /// Draws slots independently, each in proportion to its weight. Slots of weight 0 are never
  /// drawn. Requires: total() > 0. Cost: O(log num_slots) each; the paths of one call are followed
  /// side by side, so that their cache misses overlap.
  void Draw(base::Random& random, std::span<std::int64_t> slots) const;

  double weight(std::int64_t slot) const { return levels_[0][static_cast<std::size_t>(slot)]; }
  /// Returns the sum of all weights.
  double total() const;
  double alpha() const { return alpha_; }

 private:
  static constexpr std::size_t kFanOut = 8;

  void SetWeight(std::int64_t slot, double weight);

  double alpha_;
  double largest_ = 1.0;
  double new_weight_ = 1.0;  ///< largest_^alpha
  /// [0]: weights; [i + 1]: sums of eight values of [i]; the last level has eight values. Levels
  /// are padded with zeros.
  std::vector<std::vector<double>> levels_;
};

}  // namespace slalom::replay
