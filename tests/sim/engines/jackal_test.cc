#include "sim/engines/jackal/jackal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "sim/engines/jackal/engine_body.h"
#include "sim/mass_distribution.h"
#include "tests/support/error_of.h"

namespace slalom::engines {
namespace {

using test::ErrorOf;
using ::testing::AllOf;
using ::testing::HasSubstr;

double Mass(const Jackal& jackal) { return jackal.chassis_mass + kNumWheels * jackal.wheel_mass; }

/// The robot's centre of mass in C, its height above the ground.
Eigen::Vector3d Centre(const Jackal& jackal) {
  Eigen::Vector3d sum = jackal.chassis_mass * jackal.chassis_centre_C;
  for (const Eigen::Vector3d& p : jackal.wheels_C) sum += jackal.wheel_mass * p;
  return sum / Mass(jackal) + Eigen::Vector3d{0.0, 0.0, jackal.height};
}

/// About the vertical through the robot's centre of mass.
double YawInertia(const Jackal& jackal) {
  const Eigen::Vector3d centre = Centre(jackal);
  const auto square = [&](const Eigen::Vector3d& p) {
    const double x = p[0] - centre[0], y = p[1] - centre[1];
    return x * x + y * y;
  };
  double inertia =
      jackal.chassis_inertia(2, 2) + jackal.chassis_mass * square(jackal.chassis_centre_C);
  for (const Eigen::Vector3d& p : jackal.wheels_C) {
    inertia += jackal.wheel_inertia[2] + jackal.wheel_mass * square(p);
  }
  return inertia;
}

TEST(Jackal, IsTheOriginalsByDefault) {
  const Jackal jackal = MakeJackal({}, "test");
  EXPECT_NEAR(jackal.chassis_mass, 16.523, 1e-9);
  EXPECT_NEAR(jackal.chassis_inertia(2, 2), 0.4485, 2e-4);
  const Eigen::Vector3d centre{0.012, 0.002, 0.067};
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(jackal.chassis_centre_C[k], centre[k], 1e-4);
  EXPECT_NEAR(jackal.height, 0.0635, 1e-12);
  EXPECT_NEAR(jackal.wheels_C[0][0], 0.131, 1e-12);
  EXPECT_NEAR(jackal.wheels_C[3][1], -0.187795, 1e-12);
  EXPECT_TRUE(jackal.wheels_meet_obstacles);
  EXPECT_EQ(jackal.outline.half_size, (Eigen::Vector3d{0.21, 0.155, 0.092}));
}

TEST(Jackal, HasTheMassAndInertiaOfItsConfig) {
  sim::RobotConfig config;
  config.mass = 25.0;
  config.yaw_inertia = 0.9;
  config.wheel_base = 0.3;
  const Jackal jackal = MakeJackal(config, "test");
  EXPECT_NEAR(Mass(jackal), 25.0, 1e-9);
  EXPECT_NEAR(YawInertia(jackal), 0.9, 1e-9);
  // The outline is no longer that of the wheels, so it is a box.
  EXPECT_FALSE(jackal.wheels_meet_obstacles);
  EXPECT_EQ(jackal.outline.half_size, (Eigen::Vector3d{0.229, 0.208, 0.092}));
}

TEST(Jackal, HasTheCentreOfMassOfItsConfigAndTheSensor) {
  sim::RobotConfig config;
  config.centre_of_mass_x = -0.02;
  config.centre_of_mass_y = 0.01;
  config.centre_of_mass_z = 0.15;
  for (const double sensor_mass : {0.0, 1.1}) {
    config.sensor_mass = sensor_mass;
    const Jackal jackal = MakeJackal(config, "test");
    const sim::MassDistribution expected = sim::DistributeMass(config);
    EXPECT_NEAR(Mass(jackal), expected.mass, 1e-9);
    EXPECT_NEAR(Centre(jackal)[0], expected.x, 1e-9);
    EXPECT_NEAR(Centre(jackal)[1], expected.y, 1e-9);
    EXPECT_NEAR(Centre(jackal)[2], expected.height, 1e-9);
    EXPECT_NEAR(YawInertia(jackal), expected.yaw_inertia, 1e-9);
  }
}

TEST(Jackal, HasTheInertiaOfTheChassisAndTheSensor) {
  sim::RobotConfig config;
  config.sensor_mass = 0.0;
  const Jackal bare = MakeJackal(config, "test");
  config.sensor_mass = 1.1;
  const Jackal jackal = MakeJackal(config, "test");
  // The parallel axis theorem, for each of the two on its own.
  const auto about_centre = [&](double mass, const Eigen::Vector3d& p) -> Eigen::Matrix3d {
    const Eigen::Vector3d d = p - jackal.chassis_centre_C;
    return mass * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  };
  const Eigen::Vector3d sensor_C{config.sensor_x, 0.0, config.sensor_z - jackal.height};
  const Eigen::Matrix3d expected = bare.chassis_inertia +
                                   about_centre(bare.chassis_mass, bare.chassis_centre_C) +
                                   about_centre(config.sensor_mass, sensor_C);
  // Each element is a sum of at most seven numbers below 1 kg m^2, each rounded a few times.
  EXPECT_LT((jackal.chassis_inertia - expected).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_GT((jackal.chassis_inertia - bare.chassis_inertia).cwiseAbs().minCoeff(), 0.0);
}

TEST(Jackal, RefusesWhatNoWheelsCouldCarry) {
  sim::RobotConfig ideal;
  ideal.drive = sim::DriveKind::kIdeal;
  EXPECT_THAT(ErrorOf([&] { MakeJackal(ideal, "ode"); }),
              AllOf(HasSubstr("environment.robot.drive"), HasSubstr("physics ode")));
  sim::RobotConfig light;
  light.mass = 1.5;
  EXPECT_THAT(ErrorOf([&] { MakeJackal(light, "ode"); }),
              AllOf(HasSubstr("environment.robot.mass is 1.5 kg"), HasSubstr("1.908 kg")));
  sim::RobotConfig slim;
  slim.yaw_inertia = 0.1;
  EXPECT_THAT(ErrorOf([&] { MakeJackal(slim, "ode"); }),
              HasSubstr("environment.robot.yaw_inertia is 0.1"));
  sim::RobotConfig lopsided;
  lopsided.mass = 2.5;
  lopsided.yaw_inertia = 0.15;
  lopsided.centre_of_mass_x = 0.08;
  EXPECT_THAT(ErrorOf([&] { MakeJackal(lopsided, "mujoco"); }),
              HasSubstr("environment.robot.yaw_inertia is 0.15"));
  for (const double radius : {0.03, 0.6}) {
    sim::RobotConfig odd;
    odd.wheel_radius = radius;
    EXPECT_THAT(ErrorOf([&] { MakeJackal(odd, "ode"); }),
                HasSubstr("environment.robot.wheel_radius is 0."));
  }
}

/// A world in which nothing moves and nothing is touched, which keeps what it is given.
class StillWorld : public World {
 public:
  explicit StillWorld(std::vector<std::vector<sim::MovingShape>>* seen) : seen_(seen) {}
  void Reset(const base::Pose2& X_WC, const WheelAngles&) override {
    state_ = {.x = static_cast<float>(X_WC.p.x), .y = static_cast<float>(X_WC.p.y)};
  }
  bool Step(const sim::WheelSpeeds&, std::span<const sim::MovingShape> obstacles) override {
    seen_->emplace_back(obstacles.begin(), obstacles.end());
    return false;
  }
  sim::BodyState state() const override { return state_; }
  double lift() const override { return 0.0; }

 private:
  std::vector<std::vector<sim::MovingShape>>* seen_;
  sim::BodyState state_;
};

std::unique_ptr<sim::RobotBody> BodyOn(const sim::Course& course,
                                       std::vector<std::vector<sim::MovingShape>>& seen) {
  const auto make_worlds = [&seen](const Jackal&, double, int count) {
    std::vector<std::unique_ptr<World>> worlds;
    for (int i = 0; i < count; ++i) worlds.push_back(std::make_unique<StillWorld>(&seen));
    return worlds;
  };
  const std::vector scenes = {sim::MakeScene(std::make_shared<const sim::Course>(course))};
  return std::move(BodiesIn("test", make_worlds)({}, scenes, 1).front());
}

TEST(EngineBody, GivesItsWorldTheObstaclesThatAreNear) {
  sim::Course course;
  course.circles = {{{0.229 + 0.1 + 0.04, 0.0}, 0.1}, {{0.229 + 0.1 + 0.06, 0.05}, 0.1}};
  course.boxes = {{{{0.0, 1.0}, 0.0}, {3.0, 1.0 - 0.208 - 0.03}}};
  // At 1 m/s past the robot's right side, near it for about 0.5 s.
  course.moving = {{.radius = 0.05,
                    .half_size = {},
                    .key_frames = {{0.0, {{-1.0, -0.28}, 0.0}}, {2.0, {{1.0, -0.28}, 0.0}}}}};
  std::vector<std::vector<sim::MovingShape>> seen;
  const auto body = BodyOn(course, seen);
  body->Reset({}, 0);
  const sim::Scene scene(std::make_shared<const sim::Course>(course));
  body->Drive(0.0, 0.0, scene, 0.0);
  ASSERT_EQ(seen.size(), 200u);  // Steps of 1 ms.
  ASSERT_EQ(seen.back().size(), 2u);
  EXPECT_EQ(seen.back()[0].radius, 0.1f);
  EXPECT_EQ(seen.back()[1].radius, 0.0f);
  body->Drive(0.0, 0.0, scene, 0.9);
  ASSERT_EQ(seen.back().size(), 3u);
  // Where it is as the last step begins, at 1.099 s.
  EXPECT_NEAR(seen.back()[2].box.x, sim::Motion(course.moving[0]).At(1.099).X_WB.p.x, 1e-5);
  EXPECT_GT(seen.back()[2].vx, 1.0f);
}

TEST(EngineBody, GivesItsWorldTheNearestOfMany) {
  sim::Course course;
  for (int i = 0; i < 100; ++i) course.circles.push_back({{0.3 + 0.0001 * i, 0.0}, 0.05});
  std::vector<std::vector<sim::MovingShape>> seen;
  const auto body = BodyOn(course, seen);
  body->Reset({}, 0);
  body->Drive(0.0, 0.0, sim::Scene(std::make_shared<const sim::Course>(course)), 0.0);
  ASSERT_EQ(seen.back().size(), static_cast<std::size_t>(kMaxNearObstacles));
  for (const sim::MovingShape& shape : seen.back()) EXPECT_LT(shape.box.x, 0.3033f);
}

TEST(EngineBody, RefusesCoursesThatStepsOfAMillisecondCannotShow) {
  std::vector<std::vector<sim::MovingShape>> seen;
  sim::Course thin;
  thin.name = "thin";
  thin.circles = {{{3.0, 0.0}, 0.1}, {{4.0, 0.0}, 0.0004}};
  EXPECT_THAT(ErrorOf([&] { BodyOn(thin, seen); }),
              AllOf(HasSubstr("course 'thin': circle 1 is 0.0008 m wide"), HasSubstr("test")));
  sim::Course flat;
  flat.name = "flat";
  flat.boxes = {{{{3.0, 0.0}, 0.0}, {0.5, 0.0005}}};
  EXPECT_THAT(ErrorOf([&] { BodyOn(flat, seen); }), HasSubstr("course 'flat': box 0 is 0.001 m"));
  sim::Course fast;
  fast.name = "fast";
  fast.moving = {{.radius = 0.1,
                  .half_size = {},
                  .key_frames = {{0.0, {{-50.0, 3.0}, 0.0}}, {1.0, {{50.0, 3.0}, 0.0}}}}};
  EXPECT_THAT(ErrorOf([&] { BodyOn(fast, seen); }),
              AllOf(HasSubstr("course 'fast': moving obstacle 0"), HasSubstr("20 m/s")));
}

}  // namespace
}  // namespace slalom::engines
