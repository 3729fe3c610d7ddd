#pragma once

#include <span>
#include <vector>

namespace slalom::learner {

/// Whose turn it is among the shards of a table: smooth weighted round robin. In the long run the
/// shards that are there take turns in proportion to their weights. One that cannot take its turn
/// is passed over and catches up later, by 8 turns at most. Confined to one thread.
class ShardTurns {
 public:
  explicit ShardTurns(int num_shards);

  /// The shards, the one whose turn it is first.
  std::span<const int> Order();

  /// Sets a shard's weight, at least 0. Those whose weight is 0, as at first, count as of mean
  /// size.
  void SetWeight(int shard, double weight) {
    shards_[static_cast<std::size_t>(shard)].weight = weight;
  }
  /// Notes that a shard took a turn. `is_there` [shards]: who shares the turns.
  void Took(int shard, const std::vector<bool>& is_there);

 private:
  struct Shard {
    double weight = 0.0;
    double credit = 0.0;  ///< Turns that are due.
  };

  std::vector<Shard> shards_;
  std::vector<int> order_;
};

}  // namespace slalom::learner
