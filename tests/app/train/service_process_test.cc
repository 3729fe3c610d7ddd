#include "app/train/service_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/error.h"
#include "tests/support/error_of.h"

namespace slalom::train {
namespace {

using testing::HasSubstr;

TEST(ShardTest, ActorsAreSharedByTheNumbersWithWhichTheirNamesEnd) {
  for (int i = 0; i < 20; ++i) EXPECT_EQ(ShardOf("actor-" + std::to_string(i), 3), i % 3);
  EXPECT_EQ(ShardOf("node12", 8), 4);
  EXPECT_EQ(ShardOf("7", 8), 7);
  EXPECT_EQ(ShardOf("a-99999999999999999999999", 10), 9);
  EXPECT_EQ(ShardOf("actor-5", 1), 0);
}

TEST(ShardTest, NamesWithoutANumberAreSpread) {
  std::vector<int> counts(4, 0);
  for (char a = 'a'; a <= 'z'; ++a) {
    for (char b = 'a'; b <= 'z'; ++b) {
      const std::string name = {'h', '1', a, b};
      EXPECT_EQ(ShardOf(name, 4), ShardOf(name, 4));
      ++counts[static_cast<std::size_t>(ShardOf(name, 4))];
    }
  }
  for (const int count : counts) EXPECT_NEAR(count, 26 * 26 / 4, 50);
}

TEST(ShardTest, AServersNameHasItsPlace) {
  EXPECT_EQ(ServerShard("replay", 2), 0);
  EXPECT_EQ(ServerShard("replay-0", 2), 0);
  EXPECT_EQ(ServerShard("slalom-replay-1", 2), 1);
  EXPECT_EQ(ServerShard("replay-7", 1), 0) << "there is but one";
  EXPECT_THAT(test::ErrorOf([] { ServerShard("replay-2", 2); }),
              HasSubstr("'replay-2', expected a name that ends with its place among the 2"));
}

}  // namespace
}  // namespace slalom::train
