#include "base/json.h"

#include <gtest/gtest.h>

#include <string>

namespace slalom::base {
namespace {

std::string Nested(int depth) { return std::string(depth, '[') + std::string(depth, ']'); }

TEST(Json, IsReadToACertainDepth) {
  EXPECT_EQ(ParseJson(Nested(kMaxJsonDepth)).dump(), Nested(kMaxJsonDepth));
  EXPECT_TRUE(ParseJson(Nested(kMaxJsonDepth + 1)).is_discarded());
  EXPECT_TRUE(ParseJson(std::string(10'000'000, '{')).is_discarded());
  EXPECT_TRUE(ParseJson("{\"a\": 1").is_discarded()) << "no JSON";
}

TEST(Json, BracketsInTextsAndBesideEachOtherAreNotDepth) {
  const std::string text = "[\"" + std::string(1000, '[') + "\\\"" + std::string(1000, '{') + "\"]";
  EXPECT_TRUE(ParseJson(text).is_array());
  std::string many = "[";
  for (int i = 0; i < 1000; ++i) many += "[{}],";
  EXPECT_EQ(ParseJson(many + "1]").size(), 1001u);
}

}  // namespace
}  // namespace slalom::base
