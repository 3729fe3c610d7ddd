#include "base/name.h"

#include <gtest/gtest.h>

#include <string>

namespace slalom::base {
namespace {

TEST(NameTest, NamesAreWhatLabelsAndFilesCanHold) {
  EXPECT_TRUE(IsName("actor-3.node_7:9400@x"));
  EXPECT_FALSE(IsName("a/b"));
  EXPECT_FALSE(IsName(""));
  EXPECT_FALSE(IsName("a b"));
  EXPECT_FALSE(IsName("\xc3\xa9"));
  EXPECT_TRUE(IsName(std::string(128, 'z')));
  EXPECT_FALSE(IsName(std::string(129, 'z')));
}

}  // namespace
}  // namespace slalom::base
