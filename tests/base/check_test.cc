#include "base/check.h"

#include <gtest/gtest.h>

namespace slalom::base {
namespace {

TEST(CheckTest, WhatHoldsPassesAndIsEvaluatedOnce) {
  int evaluations = 0;
  SLALOM_CHECK_EQ(++evaluations, 1);
  SLALOM_CHECK(++evaluations == 2);
  EXPECT_EQ(evaluations, 2);
}

TEST(CheckDeathTest, WhatDoesNotHoldAbortsWithBothValues) {
  EXPECT_DEATH(SLALOM_CHECK_LT(2 + 3, 4), "2 \\+ 3 < 4 \\(5 and 4\\)");
  EXPECT_DEATH(SLALOM_CHECK(1 > 2), "check_test.cc.*1 > 2");
}

}  // namespace
}  // namespace slalom::base
