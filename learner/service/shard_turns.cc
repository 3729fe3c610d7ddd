#include "learner/service/shard_turns.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <numeric>

namespace slalom::learner {
namespace {

constexpr double kMostCredit = 8.0;

}  // namespace

ShardTurns::ShardTurns(int num_shards) : shards_(static_cast<std::size_t>(num_shards)) {
  order_.resize(shards_.size());
  std::iota(order_.begin(), order_.end(), 0);
}

std::span<const int> ShardTurns::Order() {
  std::ranges::stable_sort(order_, std::greater{}, [this](int shard) {
    return shards_[static_cast<std::size_t>(shard)].credit;
  });
  return order_;
}

void ShardTurns::Took(int shard, const std::vector<bool>& is_there) {
  double known = 0.0;
  int num_known = 0;
  for (const Shard& each : shards_) {
    known += each.weight;
    num_known += each.weight > 0.0 ? 1 : 0;
  }
  const double mean = num_known > 0 ? known / num_known : 1.0;
  const auto weight = [&](std::size_t i) {
    if (!is_there[i]) return 0.0;
    return shards_[i].weight > 0.0 ? shards_[i].weight : mean;
  };
  double sum = 0.0;
  for (std::size_t i = 0; i < shards_.size(); ++i) sum += weight(i);
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    const double share = sum > 0.0 ? weight(i) / sum : 0.0;
    shards_[i].credit = std::clamp(shards_[i].credit + share, -kMostCredit, kMostCredit);
  }
  shards_[static_cast<std::size_t>(shard)].credit -= 1.0;
}

}  // namespace slalom::learner
