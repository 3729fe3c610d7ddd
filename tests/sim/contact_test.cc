#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/random.h"
#include "sim/robot.h"

/// Contacts that last: a robot whose episode they do not end.

namespace slalom::sim {
namespace {

/// Greatest speeds and depth of a drive.
struct Extremes {
  double depth = 0.0;     // Into an obstacle, [m].
  double speed = 0.0;     // [m/s]
  double yaw_rate = 0.0;  // [rad/s]
  double distance = 0.0;  // From the origin along either axis, [m].
  int touched = 0;

  void Add(const Scene& scene, const BodyState& b) {
    const float clearance =
        scene.collision_map().Clearance(MakeFootprint({}), b.x, b.y, b.yaw, 1.0f);
    depth = std::max(depth, -static_cast<double>(clearance));
    speed = std::max<double>(speed, std::hypot(b.vx, b.vy));
    yaw_rate = std::max<double>(yaw_rate, std::abs(b.yaw_rate));
    distance = std::max<double>({distance, std::abs(b.x), std::abs(b.y)});
  }
};

RobotConfig WithDrive(DriveKind drive) {
  RobotConfig config;
  config.drive = drive;
  return config;
}

TEST(ContactTest, ARobotThatDrivesAgainstAWallStaysPut) {
  Course boxes, cylinders;
  boxes.boxes = {{{{1.5, 0.0}, 0.0}, {0.05, 20.0}}};
  for (int i = -100; i < 100; ++i) cylinders.circles.push_back({{1.5, 0.15 * i}, 0.075});
  for (const Course& course : {boxes, cylinders}) {
    const Scene scene(std::make_shared<const Course>(course));
    for (const DriveKind drive : {DriveKind::kSkidSteer, DriveKind::kIdeal}) {
      for (const double yaw : {0.0, 0.3, 0.8}) {
        const RobotConfig config = WithDrive(drive);
        Robot robot(config, 1);
        robot.Reset({{0.0, 0.0}, yaw});
        Extremes first, later;
        base::Pose2 settled;
        for (int step = 0; step < 1500; ++step) {
          const bool touched = robot.Drive(2.0, 0.0, scene, 0.0);
          (step < 500 ? first : later).Add(scene, robot.body());
          later.touched += step >= 500 && touched;
          if (step == 499) settled = robot.pose();
        }
        // At 2 m/s it comes 0.04 m deep in a rigid-body step; Box2D lets 0.005 m stand.
        EXPECT_LE(first.depth, 0.041) << base::EnumName(drive) << " " << yaw;
        EXPECT_LE(later.depth, 0.0051) << base::EnumName(drive) << " " << yaw;
        EXPECT_EQ(later.touched, 1000);
        EXPECT_LE(std::max(first.speed, later.speed), 2.001);
        EXPECT_NEAR(robot.pose().p.x, settled.p.x, 2e-3);
        EXPECT_NEAR(robot.pose().p.y, settled.p.y, 0.03) << "20 s of wheels at 2 m/s";
        EXPECT_NEAR(robot.pose().yaw, settled.yaw, 0.03);
        for (int step = 0; step < 25; ++step) robot.Drive(-0.5, 0.0, scene, 0.0);
        EXPECT_FALSE(robot.Drive(-0.5, 0.0, scene, 0.0)) << "and comes free";
      }
    }
  }
}

TEST(ContactTest, ScrapingNeitherExplodesNorSinksIn) {
  for (const DriveKind drive : {DriveKind::kSkidSteer, DriveKind::kIdeal}) {
    base::Random random(1);
    Extremes extremes;
    for (int round = 0; round < 10; ++round) {
      Course room;
      for (const double side : {-2.0, 2.0}) {
        room.boxes.push_back({{{side, 0.0}, 0.0}, {0.05, 2.0}});
        room.boxes.push_back({{{0.0, side}, 0.0}, {2.0, 0.05}});
      }
      for (int i = 0; i < 15; ++i) {
        const Circle circle{{random.Uniform(-2.0, 2.0), random.Uniform(-2.0, 2.0)}, 0.075};
        if (base::Norm(circle.p_W) > 0.5) room.circles.push_back(circle);
      }
      const Scene scene(std::make_shared<const Course>(room));
      const RobotConfig config = WithDrive(drive);
      Robot robot(config, 25);
      robot.Reset({});
      for (int step = 0; step < 400; ++step) {
        extremes.touched +=
            robot.Drive(random.Uniform(-2.0, 2.0), random.Uniform(-4.0, 4.0), scene, 0.0);
        extremes.Add(scene, robot.body());
      }
    }
    EXPECT_GT(extremes.touched, 1500);
    EXPECT_LT(extremes.depth, 0.05);
    EXPECT_LT(extremes.distance, 2.0 - 0.05 - 0.208 + 0.05) << "never through a wall";
    EXPECT_LT(extremes.speed, 2.01);
    EXPECT_LT(extremes.yaw_rate, 8.0);
  }
}

// Between walls that give way to nothing it is squeezed and overrun, but not shot away.
TEST(ContactTest, SweepingWallsDoNotShootItAway) {
  Course course;
  for (int row = -20; row < 20; ++row) {
    course.circles.push_back({{-2.2, 0.15 * row}, 0.075});
    course.circles.push_back({{2.2, 0.15 * row}, 0.075});
  }
  for (const double from : {-2.2, 2.2}) {
    MovingObstacle wall;
    wall.half_size = {2.0, 0.05};
    wall.key_frames = {{0.0, {{from, 0.4}, 0.1}}, {from < 0.0 ? 3.1 : 4.2, {{-from, 0.4}, 0.1}}};
    course.moving.push_back(wall);
  }
  const Scene scene(std::make_shared<const Course>(course));
  for (const DriveKind drive : {DriveKind::kSkidSteer, DriveKind::kIdeal}) {
    const RobotConfig config = WithDrive(drive);
    Robot robot(config, 1);
    base::Random random(2);
    Extremes extremes;
    for (int round = 0; round < 5; ++round) {
      robot.Reset({{0.0, -0.2}, random.Uniform(-3.0, 3.0)});
      for (int step = 0; step < 2500; ++step) {
        const base::Vec2 before = robot.pose().p;
        extremes.touched +=
            robot.Drive(random.Uniform(-1.0, 2.0), random.Uniform(-2.0, 2.0), scene, 0.02 * step);
        extremes.Add(scene, robot.body());
        // Box2D sets overlaps right by at most 0.2 m a round, three a step; a wall that jumps into
        // the robot overlaps it by up to its own length.
        EXPECT_LT(base::Norm(robot.pose().p - before), 0.3);
      }
    }
    EXPECT_GT(extremes.touched, 1000);
    EXPECT_LT(extremes.speed, 3.0);
    EXPECT_LT(extremes.yaw_rate, 10.0);
  }
}

}  // namespace
}  // namespace slalom::sim
