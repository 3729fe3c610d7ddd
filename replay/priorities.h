#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"

namespace slalom::replay {

/// The weights by which rows of a prioritized table are drawn, one per slot of its ring: a sum tree
/// of eight children a node, so that a node is a cache line.
///
/// A slot's weight is p^alpha of its priority p, or 0 where there is nothing to draw. Priorities
/// are held to [kSmallest, kLargest], so that no row is lost to a priority of 0 or drowns all
/// others. Thread-compatible. Memory: about 9.2 bytes a slot.
/// Source: Schaul et al. 2016, proportional variant.
class Priorities {
 public:
  static constexpr double kSmallest = 1e-6;
  static constexpr double kLargest = 1e6;

  /// All weights 0. Requires: num_slots >= 1, 0 <= alpha <= 1.
  Priorities(std::int64_t num_slots, double alpha);

  /// Requires: `slot` in [0, num_slots). NaN counts as `kLargest`. Cost: a path of the tree.
  void Set(std::int64_t slot, double priority);
  /// Gives a new row the largest priority that was ever `Set`, at first 1.
  void SetNew(std::int64_t slot) { SetWeight(slot, new_weight_); }
  /// Gives a row the weight that it had. Requires: 0 < weight <= kLargest.
  void RestoreWeight(std::int64_t slot, double weight) { SetWeight(slot, weight); }
  /// So large a priority was set once. Requires: largest <= kLargest.
  void RaiseLargest(double largest);
  double largest() const { return largest_; }
  /// Nothing to draw here.
  void Clear(std::int64_t slot) { SetWeight(slot, 0.0); }

  /// Draws slots independently, each in proportion to its weight; a weight of 0 never.
  /// Requires: total() > 0. Cost: O(log num_slots) each; the paths of a call are followed side by
  /// side, so that their cache misses overlap.
  void Draw(base::Random& random, std::span<std::int64_t> slots) const;

  double weight(std::int64_t slot) const { return levels_[0][static_cast<std::size_t>(slot)]; }
  /// Of all weights.
  double total() const;
  double alpha() const { return alpha_; }

 private:
  static constexpr std::size_t kFanOut = 8;

  void SetWeight(std::int64_t slot, double weight);

  double alpha_;
  double largest_ = 1.0;
  double new_weight_ = 1.0;  ///< largest_^alpha
  /// [0]: weights; [i + 1]: sums of eight of [i]; the last has eight. Zeros fill up each level.
  std::vector<std::vector<double>> levels_;
};

}  // namespace slalom::replay
