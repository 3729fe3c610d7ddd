#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "sim/robot.h"

/// The drive against the same robot in ODE and MuJoCo: tests/sim/recorded_drives/README.md.

namespace slalom::sim {
namespace {

struct Drive {
  std::array<std::array<double, 2>, 10> commands;  // Speed [m/s], turn rate [rad/s].
  std::array<base::Pose2, 2> ode, mujoco;          // After 1 s and 2 s.
};

std::vector<Drive> ReadDrives() {
  std::ifstream file(SLALOM_SOURCE_DIR "/tests/sim/recorded_drives/random_commands.txt");
  std::vector<Drive> drives;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream in(line);
    Drive& drive = drives.emplace_back();
    for (auto& [speed, turn_rate] : drive.commands) in >> speed >> turn_rate;
    for (auto* const poses : {&drive.ode, &drive.mujoco}) {
      for (base::Pose2& pose : *poses) in >> pose.p.x >> pose.p.y >> pose.yaw;
    }
    EXPECT_TRUE(in) << line;
  }
  EXPECT_EQ(drives.size(), 400u);
  return drives;
}

/// Mean distance of two lists of poses.
struct Distance {
  double position = 0.0;  // [m]
  double heading = 0.0;   // [rad]
};

/// Of this robot from an engine's after 2 s.
Distance DistanceFrom(std::array<base::Pose2, 2> Drive::*engine, const RobotConfig& config) {
  static const std::vector<Drive> drives = ReadDrives();
  const Scene open_field(std::make_shared<const Course>());
  Robot robot(config, 10);
  Distance mean;
  for (const Drive& drive : drives) {
    robot.Reset({});
    robot.TurnWheelsTo(0.0);
    for (const auto& [speed, turn_rate] : drive.commands) {
      EXPECT_FALSE(robot.Drive(speed, turn_rate, open_field, 0.0));
    }
    const base::Pose2 expected = (drive.*engine)[1], found = robot.pose();
    mean.position += base::Norm(found.p - expected.p) / static_cast<double>(drives.size());
    mean.heading +=
        std::abs(base::WrapAngle(found.yaw - expected.yaw)) / static_cast<double>(drives.size());
  }
  return mean;
}

RobotConfig WithFriction(FrictionLaw law) {
  RobotConfig config;
  config.friction = law;
  return config;
}

/// The drive as it was before friction laws: mass midway between wheels that touch at one point.
RobotConfig Centred() {
  RobotConfig config = WithFriction(FrictionLaw::kCone);
  config.centre_of_mass_x = config.centre_of_mass_y = config.centre_of_mass_z = 0.0;
  config.wheel_width = 0.0;
  return config;
}

TEST(RecordedDrivesTest, GazebosLawDrivesAsOdeDoes) {
  const Distance gazebo = DistanceFrom(&Drive::ode, WithFriction(FrictionLaw::kGazebo));
  EXPECT_LE(gazebo.position, 0.045) << "0.038";
  EXPECT_LE(gazebo.heading, 0.045) << "0.041";
  const Distance pyramid = DistanceFrom(&Drive::ode, WithFriction(FrictionLaw::kPyramid));
  EXPECT_GT(pyramid.position, 0.2) << "the axes turn in Gazebo";
  const Distance before = DistanceFrom(&Drive::ode, Centred());
  EXPECT_GT(before.position, 0.36) << "what the cone is away, whatever else there is";
  EXPECT_GT(before.heading, 0.36);
}

// Two runs of MuJoCo with other steps or stiffness of contacts are as far apart as 0.03 m.
TEST(RecordedDrivesTest, TheConeDrivesAsMujocoDoes) {
  const Distance cone = DistanceFrom(&Drive::mujoco, WithFriction(FrictionLaw::kCone));
  EXPECT_LE(cone.position, 0.046) << "0.044";
  EXPECT_LE(cone.heading, 0.050) << "0.048";
  const Distance before = DistanceFrom(&Drive::mujoco, Centred());
  EXPECT_GT(before.position, 0.048) << "0.050";
  EXPECT_GT(before.heading, 0.054) << "0.057";
  const Distance gazebo = DistanceFrom(&Drive::mujoco, WithFriction(FrictionLaw::kGazebo));
  EXPECT_GT(gazebo.position, 0.3);
}

}  // namespace
}  // namespace slalom::sim
