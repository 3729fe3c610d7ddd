#include "planners/guard/drive_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/random.h"
#include "sim/robot.h"

namespace slalom::planners {
namespace {

constexpr int kTicks = 10;  // Of 0.02 s: control steps of 0.2 s.

struct Errors {
  std::vector<double> way, heading;  // After a control step, [m] and [rad].
};

double Quantile(std::vector<double> values, double q) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

/// Predicts each step of a random drive of the simulator from its speed and turn rate, as a guard
/// does from an odometry.
Errors PredictDrive(const sim::RobotConfig& config, const RobotModel& robot, int num_steps) {
  const auto scene = sim::MakeScene(std::make_shared<const sim::Course>());
  sim::Robot truth(config, kTicks);
  truth.Reset({});
  const DriveModel model(robot, 0.2 / kTicks);
  Motion motion;
  Errors errors;
  base::Random random(3);
  double linear = 0.0, angular = 0.0;
  for (int i = 0; i < num_steps; ++i) {
    if (i % 3 == 0) {
      linear = random.Uniform(-1.0, 2.0);
      angular = random.Uniform(-3.14, 3.14);
    }
    const base::Pose2 before = truth.pose();
    const auto [s, c] = base::SinCos(before.yaw);
    const sim::BodyState& body = truth.body();
    motion.x.setZero();
    motion.y.setZero();
    motion.sin.setZero();
    motion.cos.setOnes();
    const double forward = c * body.vx + s * body.vy - body.yaw_rate * robot.centre_y;
    motion.ahead.setConstant(static_cast<float>(forward));
    motion.yaw_rate.setConstant(body.yaw_rate);
    for (int k = 0; k < kTicks; ++k) {
      model.Step(Lanes::Constant(static_cast<float>(linear)),
                 Lanes::Constant(static_cast<float>(angular)), motion);
    }
    truth.Drive(linear, angular, *scene, 0.0);
    const base::Vec2 centre{robot.centre_x, robot.centre_y};
    const base::Vec2 found =
        base::InverseTransform(before, base::Transform(truth.pose(), centre)) - centre;
    errors.way.push_back(base::Norm(found - base::Vec2{motion.x[7], motion.y[7]}));
    const double turned = base::WrapAngle(truth.pose().yaw - before.yaw);
    errors.heading.push_back(
        std::abs(base::WrapAngle(turned - std::atan2(motion.sin[7], motion.cos[7]))));
  }
  return errors;
}

TEST(DriveModelTest, PredictsAStepOfTheSimulatorsWheels) {
  const Errors errors = PredictDrive({}, {}, 3000);
  EXPECT_LT(Quantile(errors.way, 0.99), 0.01);
  EXPECT_LT(Quantile(errors.heading, 0.95), 0.02);
}

TEST(DriveModelTest, PredictsAPyramidAsAPyramid) {
  sim::RobotConfig robot;
  robot.friction = sim::FrictionLaw::kPyramid;
  RobotModel model;
  model.pyramid = true;
  const Errors pyramid = PredictDrive(robot, model, 3000);
  const Errors cone = PredictDrive(robot, {}, 3000);
  EXPECT_LT(Quantile(pyramid.way, 0.99), 0.025);
  EXPECT_LT(Quantile(pyramid.way, 0.9), 0.5 * Quantile(cone.way, 0.9));
  EXPECT_LT(Quantile(pyramid.heading, 0.9), 0.5 * Quantile(cone.heading, 0.9));
}

// Grip comes and goes with the angles of the wheels: the mean is what is left to know.
TEST(DriveModelTest, PredictsGazebosFrictionBestByAPyramidOfMeanGrip) {
  sim::RobotConfig gazebo;
  gazebo.friction = sim::FrictionLaw::kGazebo;
  const auto way = [&](const RobotModel& robot) {
    return Quantile(PredictDrive(gazebo, robot, 3000).way, 0.9);
  };
  RobotModel mean, cone, full;
  mean.friction = cone.friction = 0.32;
  mean.pyramid = full.pyramid = true;
  EXPECT_LT(way(mean), way(cone));
  EXPECT_LT(way(mean), way(full));
}

}  // namespace
}  // namespace slalom::planners
