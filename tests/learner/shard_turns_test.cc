#include "learner/service/shard_turns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace slalom::learner {
namespace {

using testing::ElementsAre;

/// Takes turns of the shards that can; returns how many each took.
std::vector<int> Take(ShardTurns& turns, int count, const std::vector<bool>& is_there,
                      const std::vector<bool>& can) {
  std::vector<int> taken(is_there.size(), 0);
  for (int i = 0; i < count; ++i) {
    const auto order = turns.Order();
    const auto next = std::ranges::find_if(
        order, [&](int shard) { return can[static_cast<std::size_t>(shard)]; });
    const int shard = *next;
    ++taken[static_cast<std::size_t>(shard)];
    turns.Took(shard, is_there);
  }
  return taken;
}

TEST(ShardTurnsTest, AreInProportionToTheWeights) {
  const std::vector<bool> all(3, true);
  ShardTurns turns(3);
  EXPECT_THAT(Take(turns, 30, all, all), ElementsAre(10, 10, 10)) << "no weights yet";
  turns.SetWeight(0, 200.0);
  turns.SetWeight(1, 600.0);
  EXPECT_THAT(Take(turns, 120, all, all), ElementsAre(20, 60, 40)) << "the third is of mean size";
  turns.SetWeight(2, 1200.0);
  for (int i = 0; i < 5; ++i) {  // In every stretch, not only in all.
    const std::vector<int> taken = Take(turns, 10, all, all);
    EXPECT_NEAR(taken[0], 1, 1);
    EXPECT_NEAR(taken[1], 3, 1);
    EXPECT_NEAR(taken[2], 6, 1);
  }
}

TEST(ShardTurnsTest, OneThatCouldNotCatchesUpABit) {
  const std::vector<bool> all(2, true);
  ShardTurns turns(2);
  EXPECT_THAT(Take(turns, 1000, all, {true, false}), ElementsAre(1000, 0));
  const std::vector<int> taken = Take(turns, 100, all, all);
  EXPECT_GE(taken[1], 54);
  EXPECT_LE(taken[1], 50 + 2 * 8);
  EXPECT_THAT(Take(turns, 100, all, all), ElementsAre(50, 50));
}

TEST(ShardTurnsTest, OthersShareTheTurnsOfOneThatIsGone) {
  ShardTurns turns(3);
  for (int i = 0; i < 3; ++i) turns.SetWeight(i, 100.0 * (i + 1));
  EXPECT_THAT(Take(turns, 300, {true, true, false}, {true, true, false}), ElementsAre(100, 200, 0));
  EXPECT_THAT(Take(turns, 60, std::vector<bool>(3, true), std::vector<bool>(3, true)),
              ElementsAre(10, 20, 30));
}

}  // namespace
}  // namespace slalom::learner
