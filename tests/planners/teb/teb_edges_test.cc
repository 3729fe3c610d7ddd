#include "planners/teb/teb_edges.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "base/random.h"

namespace slalom::planners {
namespace {

/// Unknowns in the band's order: x, y, yaw, dt, x, y, yaw, dt, ...
using Unknowns = std::vector<double>;

base::Pose2 PoseAt(const Unknowns& u, std::size_t i) { return {{u[i], u[i + 1]}, u[i + 2]}; }

Unknowns Draw(base::Random& random, int size) {
  Unknowns u;
  for (int i = 0; i < size; ++i) {
    u.push_back(i % 4 == 3   ? random.Uniform(0.1, 0.6)
                : i % 4 == 2 ? random.Uniform(-1.2, 1.2)
                             : random.Uniform(-1.0, 1.0));
  }
  return u;
}

/// Compares with central differences. Their error is about h^2 / 6 times the third derivative: the
/// sign of a motion bends with 100 / m, so 1e-12 / 6 * 1e6 and the speed's own factors: 1e-5.
template <int N>
void ExpectGradient(const std::function<Dual<N>(const Unknowns&)>& edge, std::uint64_t seed) {
  base::Random random(seed);
  const double h = 1e-6;
  for (int trial = 0; trial < 200; ++trial) {
    const Unknowns u = Draw(random, N);
    const Dual<N> at = edge(u);
    for (int i = 0; i < N; ++i) {
      Unknowns more = u, less = u;
      more[i] += h;
      less[i] -= h;
      const double slope = (edge(more).value - edge(less).value) / (2.0 * h);
      EXPECT_NEAR(at.gradient[i], slope, 1e-4 * (1.0 + std::abs(slope))) << "unknown " << i;
    }
  }
}

TEST(TebEdges, HaveTheDerivativesOfFiniteDifferences) {
  ExpectGradient<kPairSize>(
      [](const Unknowns& u) { return MotionBetween(PoseAt(u, 0), u[3], PoseAt(u, 4)).linear; }, 1);
  ExpectGradient<kPairSize>(
      [](const Unknowns& u) { return MotionBetween(PoseAt(u, 0), u[3], PoseAt(u, 4)).angular; }, 2);
  ExpectGradient<kPairSize>(
      [](const Unknowns& u) { return NonholonomicError(PoseAt(u, 0), PoseAt(u, 4)); }, 3);
  ExpectGradient<kPairSize>(
      [](const Unknowns& u) { return ForwardWay(PoseAt(u, 0), PoseAt(u, 4)); }, 4);
  ExpectGradient<kPairSize>(
      [](const Unknowns& u) { return DistanceBetween(PoseAt(u, 0), PoseAt(u, 4)); }, 5);
  ExpectGradient<3>([](const Unknowns& u) { return DistanceToPoint(PoseAt(u, 0), {0.3, 2.0}); }, 6);
  for (const bool is_start : {true, false}) {
    ExpectGradient<kPairSize>(
        [is_start](const Unknowns& u) {
          const PairMotion motion = MotionBetween(PoseAt(u, 0), u[3], PoseAt(u, 4));
          return AccelerationAtEnd(motion.linear, u[3], 0.4, is_start);
        },
        7);
  }
  for (const bool turns : {true, false}) {
    ExpectGradient<kTripleSize>(
        [turns](const Unknowns& u) {
          const PairMotion one = MotionBetween(PoseAt(u, 0), u[3], PoseAt(u, 4));
          const PairMotion two = MotionBetween(PoseAt(u, 4), u[7], PoseAt(u, 8));
          return turns ? AccelerationBetween(one.angular, u[3], two.angular, u[7])
                       : AccelerationBetween(one.linear, u[3], two.linear, u[7]);
        },
        8);
  }
}

TEST(TebEdges, KnowSpeedsAndTheirSigns) {
  const double sign = 20.0 / 21.0;  // 100 / m * 0.2 m, over one more.
  const PairMotion ahead = MotionBetween({{0.0, 0.0}, 0.0}, 0.4, {{0.2, 0.0}, 0.1});
  EXPECT_NEAR(ahead.linear.value, 0.5 * sign, 1e-12);
  EXPECT_NEAR(ahead.angular.value, 0.25, 1e-12);
  EXPECT_NEAR(MotionBetween({{0.0, 0.0}, 0.0}, 0.4, {{-0.2, 0.0}, 0.0}).linear.value, -0.5 * sign,
              1e-12);
  // Across the cut of angles: 0.2 rad to the left.
  EXPECT_NEAR(
      MotionBetween({{0.0, 0.0}, 3.0415926535897931}, 0.5, {{0.0, 0.0}, -3.0415926535897931})
          .angular.value,
      0.4, 1e-9);
  EXPECT_EQ(MotionBetween({{1.0, 1.0}, 0.3}, 0.4, {{1.0, 1.0}, 0.3}).linear.value, 0.0);
}

TEST(TebEdges, KnowAccelerations) {
  // From 0.4 to 0.7 m/s between the middles of 0.2 s and 0.4 s: over 0.3 s.
  const Dual<kPairSize> slow{.value = 0.4}, fast{.value = 0.7};
  EXPECT_NEAR(AccelerationBetween(slow, 0.2, fast, 0.4).value, 1.0, 1e-12);
  EXPECT_NEAR(AccelerationAtEnd(fast, 0.2, 0.5, true).value, 1.0, 1e-12);
  EXPECT_NEAR(AccelerationAtEnd(fast, 0.2, 0.0, false).value, -3.5, 1e-12);
}

TEST(TebEdges, AreZeroOnACommonArc) {
  base::Random random(9);
  for (int i = 0; i < 100; ++i) {
    const double radius = random.Uniform(0.2, 5.0), from = random.Uniform(-3.0, 3.0);
    const double to = from + random.Uniform(-1.0, 1.0);
    const auto on_arc = [radius](double yaw) {
      return base::Pose2{{radius * std::sin(yaw), -radius * std::cos(yaw)}, yaw};
    };
    EXPECT_NEAR(NonholonomicError(on_arc(from), on_arc(to)).value, 0.0, 1e-12);
  }
  // Sideways by 0.1 m: twice that.
  EXPECT_NEAR(NonholonomicError({{0.0, 0.0}, 0.0}, {{0.3, 0.1}, 0.0}).value, 0.2, 1e-12);
}

TEST(TebEdges, PenalizeWhatIsOutside) {
  EXPECT_EQ(PenalizeOutside(0.2, -0.2, 0.6, 0.1).value, 0.0);
  EXPECT_NEAR(PenalizeOutside(0.55, -0.2, 0.6, 0.1).value, 0.05, 1e-12);
  EXPECT_EQ(PenalizeOutside(0.55, -0.2, 0.6, 0.1).slope, 1.0);
  EXPECT_NEAR(PenalizeOutside(-0.3, -0.2, 0.6, 0.1).value, 0.2, 1e-12);
  EXPECT_EQ(PenalizeOutside(-0.3, -0.2, 0.6, 0.1).slope, -1.0);
  EXPECT_NEAR(PenalizeBelow(0.2, 0.25, 0.1).value, 0.15, 1e-12);
  EXPECT_EQ(PenalizeBelow(0.36, 0.25, 0.1).value, 0.0);
}

}  // namespace
}  // namespace slalom::planners
