#include "base/geometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace slalom::base {
namespace {

TEST(GeometryTest, SinCosIsWithin1e15OfTheLibrary) {
  Random random(1);
  for (int i = 0; i < 300000; ++i) {
    const double scale = std::pow(10.0, random.Uniform(-8.0, 5.0));
    const double angle = random.Uniform(-scale, scale);
    // Reduced by 2 pi in long double, as the library's own argument reduction is not under test.
    const auto exact = static_cast<long double>(angle);
    const SinCosResult result = SinCos(angle);
    ASSERT_NEAR(result.sin, static_cast<double>(std::sin(exact)), 1e-15) << angle;
    ASSERT_NEAR(result.cos, static_cast<double>(std::cos(exact)), 1e-15) << angle;
  }
}

TEST(GeometryTest, SinCosAtTheSeamsOfItsQuadrants) {
  for (int quarter = -9; quarter <= 9; ++quarter) {
    for (const double nudge : {-1e-9, 0.0, 1e-9}) {
      const double angle = quarter * (kPi / 4) + nudge;
      EXPECT_NEAR(SinCos(angle).sin, std::sin(angle), 1e-15) << angle;
      EXPECT_NEAR(SinCos(angle).cos, std::cos(angle), 1e-15) << angle;
    }
  }
}

TEST(GeometryTest, WrapAngleKeepsTheDirectionAndLandsInTheHalfOpenTurn) {
  EXPECT_EQ(WrapAngle(kPi), -kPi);
  EXPECT_EQ(WrapAngle(-kPi), -kPi);
  EXPECT_EQ(WrapAngle(0.0), 0.0);
  Random random(2);
  for (int i = 0; i < 100000; ++i) {
    const double angle = random.Uniform(-1000.0, 1000.0);
    const double wrapped = WrapAngle(angle);
    ASSERT_GE(wrapped, -kPi);
    ASSERT_LT(wrapped, kPi);
    // 1000 has an ulp of 1.1e-13, and so much may the subtraction of whole turns lose.
    ASSERT_NEAR(std::sin(wrapped - angle), 0.0, 1e-12);
    ASSERT_GT(std::cos(wrapped - angle), 0.0);
  }
}

TEST(GeometryTest, TransformsUndoEachOther) {
  Random random(3);
  for (int i = 0; i < 10000; ++i) {
    const Pose2 X_WR{{random.Uniform(-20, 20), random.Uniform(-20, 20)}, random.Uniform(-9, 9)};
    const Vec2 p_R{random.Uniform(-20, 20), random.Uniform(-20, 20)};
    const Vec2 back = InverseTransform(X_WR, Transform(X_WR, p_R));
    ASSERT_NEAR(back.x, p_R.x, 1e-13 * 100);
    ASSERT_NEAR(back.y, p_R.y, 1e-13 * 100);
  }
}

TEST(GeometryTest, AQuarterTurnTakesForwardToLeft) {
  const Vec2 p_W = Transform({{1.0, 2.0}, kPi / 2}, {3.0, 0.0});
  EXPECT_NEAR(p_W.x, 1.0, 1e-15);
  EXPECT_NEAR(p_W.y, 5.0, 1e-15);
}

}  // namespace
}  // namespace slalom::base
