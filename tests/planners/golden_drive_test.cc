// One number for everything that a planner computes: the same in debug and release, from run to
// run.

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <vector>

#include "planners/navigation/navigator.h"
#include "planners/planner_registry.h"

namespace slalom::planners {
namespace {

/// Posts of 0.1 m radius on the way from (0, 0) to (8, 0).
constexpr base::Vec2 kPosts[] = {{1.5, 0.2}, {2.2, -0.9}, {3.0, 0.9},  {3.4, -0.3},
                                 {4.4, 0.1}, {4.9, 1.1},  {5.6, -0.6}, {6.3, 0.5}};

/// Ranges to the posts, up to 5 m, [cm].
std::vector<std::uint16_t> Scan(const ScanGeometry& geometry, const base::Pose2& X_OR) {
  const base::Vec2 sensor_O = base::Transform(X_OR, geometry.p_RS);
  std::vector<std::uint16_t> ranges;
  for (int beam = 0; beam < geometry.num_beams; ++beam) {
    const double angle =
        X_OR.yaw +
        geometry.field_of_view * (static_cast<double>(beam) / (geometry.num_beams - 1) - 0.5);
    const auto [s, c] = base::SinCos(angle);
    double range = geometry.clip;
    for (const base::Vec2 post : kPosts) {
      const base::Vec2 d = post - sensor_O;
      const double along = base::Dot(d, {c, s}), across = base::Cross(d, {c, s});
      const double half_chord2 = 0.01 - across * across;
      if (along > 0.0 && half_chord2 > 0.0) range = std::min(range, along - std::sqrt(half_chord2));
    }
    ranges.push_back(static_cast<std::uint16_t>(std::lround(100.0 * range)));
  }
  return ranges;
}

std::uint64_t DriveAndHash(const std::string& name) {
  const PlannersConfig config;
  const ScanGeometry geometry{.num_beams = 360};
  Navigator navigator(config.navigation, NavigationOf(name, config), geometry, 0.05,
                      MakeLocalPlanner(name, config));
  base::Pose2 X_OR;
  Twist velocity;
  navigator.Reset(X_OR, {8.0, 0.0}, 1);
  std::uint64_t hash = 0xcbf29ce484222325u;
  const auto add = [&](double value) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001b3u;
  };
  for (int step = 0; step < 200; ++step) {
    velocity = navigator.Step(Scan(geometry, X_OR), X_OR, velocity);
    const auto [s, c] = base::SinCos(X_OR.yaw);
    X_OR.p = X_OR.p + 0.05 * velocity.linear * base::Vec2{c, s};
    X_OR.yaw = base::WrapAngle(X_OR.yaw + 0.05 * velocity.angular);
    add(velocity.linear);
    add(velocity.angular);
  }
  EXPECT_GT(X_OR.p.x, 1.5) << name << " drives";
  return hash;
}

// The numbers are those of this code, not of ROS; a change of behaviour changes them.
TEST(GoldenDrive, Dwa) { EXPECT_EQ(DriveAndHash("dwa"), 488127223416168546u); }

TEST(GoldenDrive, ElasticBand) { EXPECT_EQ(DriveAndHash("eband"), 9061347328799170412u); }

}  // namespace
}  // namespace slalom::planners
