#include "base/split.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>

namespace slalom::base {
namespace {

TEST(ParseNumberTest, TakesAWholeTextOrNothing) {
  EXPECT_EQ(ParseNumber<int>("-17"), -17);
  EXPECT_EQ(ParseNumber<std::uint64_t>("18446744073709551615"), UINT64_MAX);
  EXPECT_EQ(ParseNumber<double>("1e3"), 1000.0);
  for (const char* text : {"", " 1", "1 ", "+1", "1e3", "2147483648", "0x10", "nan"}) {
    EXPECT_EQ(ParseNumber<int>(text), std::nullopt) << text;
  }
  EXPECT_EQ(ParseNumber<std::uint64_t>("-1"), std::nullopt);
  EXPECT_EQ(ParseNumber<double>("1e999"), std::nullopt);
}

}  // namespace
}  // namespace slalom::base
