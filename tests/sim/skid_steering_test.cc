#include "sim/skid_steering.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/random.h"
#include "sim/robot.h"

namespace slalom::sim {
namespace {

constexpr double kGravity = 9.8;  // [m/s^2]
constexpr double kDt = 0.02;      // [s]
constexpr FrictionLaw kLaws[] = {FrictionLaw::kCone, FrictionLaw::kPyramid, FrictionLaw::kGazebo};

RobotConfig WithFriction(FrictionLaw law) {
  RobotConfig config;
  config.friction = law;
  return config;
}

/// Masses midway between wheels that touch the ground at one point each: closed forms hold.
RobotConfig Centred(FrictionLaw law = FrictionLaw::kCone) {
  RobotConfig config = WithFriction(law);
  config.centre_of_mass_x = config.centre_of_mass_y = 0.0;
  config.wheel_width = 0.0;
  return config;
}

/// The equations of motion in the body's frame, in double precision: what `SkidSteering` solves.
/// Velocity of the centre of mass, pose of the point midway between the wheels.
struct State {
  double ahead = 0.0, left = 0.0, yaw_rate = 0.0;  // [m/s], [rad/s]
  double x = 0.0, y = 0.0, yaw = 0.0;              // [m], [rad]
  double angle_left = 0.0, angle_right = 0.0;      // Of the wheels, [rad].
};

/// Force of the ground on a contact that slips, [N].
base::Vec2 Friction(const RobotConfig& config, double load, double slip_ahead, double slip_left,
                    double angle, double creep) {
  const double mu = config.wheel_friction;
  const auto sign = [&](double s) { return s / std::hypot(s, creep); };
  if (config.friction == FrictionLaw::kPyramid) {
    return {-mu * load * sign(slip_ahead), -mu * load * sign(slip_left)};
  }
  if (config.friction == FrictionLaw::kGazebo) {
    const double c = std::cos(angle), s = std::sin(angle);
    // Along (c, 0, -s) it is -mu normal sign(slip_ahead c); the vertical parts add up to the load.
    const double way = sign(slip_ahead) * (c < 0.0 ? -1.0 : 1.0);
    const double normal = load / (1.0 + mu * way * s);
    return {-mu * normal * way * c, -mu * normal * sign(slip_left) * std::abs(c)};
  }
  const double slip = std::sqrt(slip_ahead * slip_ahead + slip_left * slip_left + creep * creep);
  return {-mu * load * slip_ahead / slip, -mu * load * slip_left / slip};
}

State Derivative(const RobotConfig& config, const State& s, double wheel_left, double wheel_right,
                 double creep) {
  const double mass = config.mass, weight = mass * kGravity;
  const double cx = config.centre_of_mass_x, cy = config.centre_of_mass_y;
  const double a = 0.5 * config.wheel_base, b = 0.5 * config.track;
  double force_ahead = 0.0, force_left = 0.0, torque = 0.0;
  for (const double wheel_x : {a, -a}) {
    for (const double wheel_y : {b, -b}) {
      const double load = 0.25 * weight * (1.0 + cx * wheel_x / (a * a) + cy * wheel_y / (b * b));
      for (const double edge : {-0.5 * config.wheel_width, 0.5 * config.wheel_width}) {
        const double x = wheel_x - cx, y = wheel_y + edge - cy;
        const bool is_left = wheel_y > 0.0;
        const base::Vec2 force =
            Friction(config, 0.5 * load, s.ahead - s.yaw_rate * y - (is_left ? wheel_left : wheel_right),
                     s.left + s.yaw_rate * x, is_left ? s.angle_left : s.angle_right, creep);
        force_ahead += force.x;
        force_left += force.y;
        torque += x * force.y - y * force.x;
      }
    }
  }
  const double middle_ahead = s.ahead + s.yaw_rate * cy, middle_left = s.left - s.yaw_rate * cx;
  return {.ahead = force_ahead / mass + s.yaw_rate * s.left,
          .left = force_left / mass - s.yaw_rate * s.ahead,
          .yaw_rate = torque / config.yaw_inertia,
          .x = middle_ahead * std::cos(s.yaw) - middle_left * std::sin(s.yaw),
          .y = middle_ahead * std::sin(s.yaw) + middle_left * std::cos(s.yaw),
          .yaw = s.yaw_rate,
          .angle_left = wheel_left / config.wheel_radius,
          .angle_right = wheel_right / config.wheel_radius};
}

State Plus(const State& s, double h, const State& d) {
  return {.ahead = s.ahead + h * d.ahead,
          .left = s.left + h * d.left,
          .yaw_rate = s.yaw_rate + h * d.yaw_rate,
          .x = s.x + h * d.x,
          .y = s.y + h * d.y,
          .yaw = s.yaw + h * d.yaw,
          .angle_left = s.angle_left + h * d.angle_left,
          .angle_right = s.angle_right + h * d.angle_right};
}

/// The controller's wheel speeds, and its limits on how they change.
struct Controller {
  const RobotConfig& config;
  double linear = 0.0, angular = 0.0;  // [m/s], [rad/s]

  void Tick(double to_linear, double to_angular, double dt) {
    const double dv = config.linear_acceleration * dt, dw = config.angular_acceleration * dt;
    linear += std::clamp(to_linear - linear, -dv, dv);
    angular += std::clamp(to_angular - angular, -dw, dw);
  }
  double side() const { return 0.5 * config.track * config.wheel_separation_multiplier * angular; }
};

/// Midpoint rule with steps of 2e-5 s, a tenth of the fastest decay, creep / (friction x g).
void Integrate(Controller& controller, double linear, double angular, double duration, State& s) {
  constexpr double kStep = 2e-5, kCreep = 1e-3;
  const int n = static_cast<int>(std::lround(duration / kStep));
  for (int i = 0; i < n; ++i) {
    controller.Tick(linear, angular, kStep);
    const double left = controller.linear - controller.side();
    const double right = controller.linear + controller.side();
    const State half = Plus(s, 0.5 * kStep, Derivative(controller.config, s, left, right, kCreep));
    s = Plus(s, kStep, Derivative(controller.config, half, left, right, kCreep));
  }
}

/// Drives on an open field, a rigid-body step at a time unless told otherwise.
class OpenField {
 public:
  explicit OpenField(const RobotConfig& config, int num_substeps = 1)
      : config_(config), contacts_(config), robot_(config, num_substeps) {
    robot_.Reset({});
    robot_.TurnWheelsTo(0.0);
  }
  void Drive(double linear, double angular, int num_steps = 1) {
    for (int i = 0; i < num_steps; ++i) {
      EXPECT_FALSE(robot_.Drive(linear, angular, scene_, 0.0, contacts_));
    }
  }
  base::Pose2 pose() const { return robot_.pose(); }
  const BodyState& body() const { return robot_.body(); }
  double speed() const { return std::hypot(robot_.body().vx, robot_.body().vy); }
  /// Velocity of the centre of mass in the directions `yaw` [rad].
  State CentreSeenFrom(double yaw) const {
    const BodyState& b = robot_.body();
    const double c = std::cos(yaw), s = std::sin(yaw);
    const double to_x = std::cos(b.yaw) * config_.centre_of_mass_x - std::sin(b.yaw) * config_.centre_of_mass_y;
    const double to_y = std::sin(b.yaw) * config_.centre_of_mass_x + std::cos(b.yaw) * config_.centre_of_mass_y;
    const double vx = b.vx - b.yaw_rate * to_y, vy = b.vy + b.yaw_rate * to_x;
    return {.ahead = c * vx + s * vy, .left = c * vy - s * vx, .yaw_rate = b.yaw_rate};
  }

 private:
  const RobotConfig config_;
  const Scene scene_{std::make_shared<const Course>()};
  ContactWorld contacts_;
  Robot robot_;
};

/// Acceleration at which all four wheels slip, [m/s^2].
double SlipLimit(const RobotConfig& config) { return config.wheel_friction * kGravity; }

TEST(SkidSteeringTest, SpeedsUpAsFrictionAllowsAndThenHoldsItsSpeed) {
  for (const double target : {0.5, 1.0, 2.0, -2.0}) {
    const RobotConfig config = Centred();
    OpenField field(config);
    for (int i = 1; i <= 50; ++i) {
      field.Drive(target, 0.0);
      const double possible = SlipLimit(config) * kDt * i;
      // Four rounds leave some mm/s as the slip goes to its end; the step in which it ends is
      // shared.
      const double tolerance = possible < std::abs(target) - 0.1 ? 5e-3 : 0.05;
      EXPECT_NEAR(std::abs(field.body().vx), std::min(possible, std::abs(target)), tolerance);
    }
    EXPECT_NEAR(field.body().vx, target, 1e-6);
    const double time = 1.0, ramp = std::abs(target) / SlipLimit(config);
    // A step moves at the speed of its end: half a step too far while it speeds up.
    EXPECT_NEAR(std::abs(field.pose().p.x), std::abs(target) * (time - 0.5 * ramp + 0.5 * kDt),
                0.01 * std::abs(target));
    EXPECT_EQ(field.pose().p.y, 0.0) << "not a bit to the side";
    EXPECT_EQ(field.pose().yaw, 0.0);
  }
}

TEST(SkidSteeringTest, BrakesWithinTheDistanceThatFrictionOrControllerAllow) {
  for (const double limit : {2.0, 4.0, 20.0}) {
    for (const double speed : {0.5, 1.0, 2.0}) {
      RobotConfig config;
      config.linear_acceleration = limit;
      OpenField field(config);
      field.Drive(speed, 0.0, 100);
      const double start = field.pose().p.x;
      field.Drive(0.0, 0.0, 100);
      const double deceleration = std::min(limit, SlipLimit(config));
      // As it moves at the speed of a step's end it stops up to a step's way early.
      EXPECT_NEAR(field.pose().p.x - start,
                  speed * speed / (2.0 * deceleration) - 0.5 * kDt * speed, 0.3 * kDt * speed)
          << speed << " m/s, " << limit << " m/s^2";
      EXPECT_NEAR(field.speed(), 0.0, 1e-6);
    }
  }
}

TEST(SkidSteeringTest, TurnRateInPureRotationFollowsFromTheGeometry) {
  const RobotConfig jackal = Centred();
  RobotConfig other = jackal;
  other.wheel_base = 0.4;
  other.track = 0.3;
  other.wheel_separation_multiplier = 2.0;
  other.wheel_friction = 0.9;
  for (const RobotConfig& config : {jackal, other}) {
    const double a = 0.5 * config.wheel_base, b = 0.5 * config.track;
    const double ratio = b * b * config.wheel_separation_multiplier / (a * a + b * b);
    for (const double rate : {0.1, 0.5, 1.57, 3.14, -3.14}) {
      OpenField field(config);
      field.Drive(0.0, rate, 150);
      // Slip of (a, b - B/2) per rad/s, 0.09 m/s and more, is rounded off at 1e-3 m/s: 1e-4 of it.
      // Other rates are the same but for scale.
      const double rounding = std::abs(rate) < 0.2 ? 1e-2 : 1e-3;
      EXPECT_NEAR(field.body().yaw_rate / rate, ratio, rounding * ratio) << rate;
      EXPECT_NEAR(base::Norm(field.pose().p), 0.0, 1e-4);
    }
  }
}

// The wheels' grip ahead has the longer arm, so it wins against the grip across: no slip ahead.
TEST(SkidSteeringTest, OnPyramidsItTurnsOnTheSpotWithoutSlipAhead) {
  const RobotConfig config = Centred(FrictionLaw::kPyramid);
  for (const double rate : {0.5, 1.57, -2.0}) {
    OpenField field(config);
    field.Drive(0.0, rate, 150);
    EXPECT_NEAR(field.body().yaw_rate / rate, config.wheel_separation_multiplier, 0.02) << rate;
  }
}

TEST(SkidSteeringTest, OnGazebosPyramidGripDependsOnTheAnglesOfTheWheels) {
  const RobotConfig config = Centred(FrictionLaw::kGazebo);
  const SkidSteering skid_steering(config, kDt);
  for (const double angle : {-1.5, -0.8, -0.2, 0.0, 0.3, 1.0, 1.57}) {
    WheelAngles angles;
    angles.fill(static_cast<float>(angle));
    for (const float ahead : {1.0f, -1.0f}) {
      BodyVelocity v{ahead, 0.0f, 0.0f};
      v = skid_steering.Step(v, v, {}, angles);
      // A wheel that slides towards where its axis points into the ground is pressed down less.
      const double mu = config.wheel_friction;
      const double grip = std::abs(std::cos(angle)) / (1.0 + mu * ahead * std::sin(angle));
      EXPECT_NEAR(v.ahead, ahead * (1.0 - mu * kGravity * grip * kDt), 2e-4) << angle;
    }
  }
}

TEST(SkidSteeringTest, WheelsTurnAsTheirSpeedsSayUpToHalfTurns) {
  const RobotConfig config = WithFriction(FrictionLaw::kGazebo);
  const SkidSteering skid_steering(config, kDt);
  base::Random random(5);
  WheelAngles angles{};
  double left = 0.0, right = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const WheelSpeeds speeds{static_cast<float>(random.Uniform(-3.0, 3.0)),
                             static_cast<float>(random.Uniform(-3.0, 3.0))};
    skid_steering.Turn(speeds, kDt, angles);
    left += kDt * speeds.left / config.wheel_radius;
    right += kDt * speeds.right / config.wheel_radius;
    for (const int front : {0, 2}) {
      EXPECT_LT(std::abs(angles[front]), 1.5709f);
      EXPECT_NEAR(std::sin(2.0 * (angles[front] - left)), 0.0, 1e-3);
      EXPECT_NEAR(std::sin(2.0 * (angles[front + 1] - right)), 0.0, 1e-3);
      EXPECT_GT(std::cos(2.0 * (angles[front] - left)), 0.0) << "half turns, not quarters";
      EXPECT_GT(std::cos(2.0 * (angles[front + 1] - right)), 0.0);
    }
  }
}

TEST(SkidSteeringTest, WheelsBeginAtAnglesOfTheSeed) {
  const RobotConfig config = WithFriction(FrictionLaw::kGazebo);
  const Scene scene(std::make_shared<const Course>());
  ContactWorld contacts(config);
  Robot robot(config, 10);
  const auto drive = [&](std::uint64_t seed) {
    robot.Reset({}, seed);
    for (int i = 0; i < 10; ++i) robot.Drive(1.0, 2.0, scene, 0.0, contacts);
    return robot.body();
  };
  const BodyState first = drive(1);
  EXPECT_EQ(drive(1), first);
  EXPECT_NE(drive(2), first);
}

/// Mean errors against fine explicit integration under commands that jump by up to 3 m/s.
struct Errors {
  double velocity = 0.0;  // [m/s]
  double position = 0.0;  // Over 2 s, [m].
};

Errors ErrorsAt(double control_rate, FrictionLaw law) {
  constexpr int kRounds = 20, kCommands = 10;
  Errors mean;
  base::Random random(1);
  RobotConfig config = WithFriction(law);
  config.control_rate = control_rate;
  for (int round = 0; round < kRounds; ++round) {
    OpenField field(config, static_cast<int>(std::lround(0.2 * control_rate)));
    Controller controller{config};
    State truth;
    for (int k = 0; k < kCommands; ++k) {
      const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
      field.Drive(v, w);
      Integrate(controller, v, w, 0.2, truth);
      const State found = field.CentreSeenFrom(truth.yaw);
      mean.velocity += std::hypot(found.ahead - truth.ahead, found.left - truth.left) / (kRounds * kCommands);
      mean.position += base::Norm(field.pose().p - base::Vec2{truth.x, truth.y}) / (kRounds * kCommands);
    }
  }
  return mean;
}

// The same velocities and poses, and half the error with half the step.
TEST(SkidSteeringTest, ConvergesToTheEquationsOfMotion) {
  for (const FrictionLaw law : kLaws) {
    const Errors coarse = ErrorsAt(50.0, law), middle = ErrorsAt(100.0, law), fine = ErrorsAt(200.0, law);
    EXPECT_LT(coarse.velocity, 0.03) << base::EnumName(law);
    EXPECT_LT(coarse.position, 0.02) << base::EnumName(law);
    EXPECT_NEAR(coarse.velocity / middle.velocity, 2.0, 0.4) << base::EnumName(law);
    EXPECT_NEAR(middle.velocity / fine.velocity, 2.0, 0.4) << base::EnumName(law);
    EXPECT_NEAR(coarse.position / middle.position, 2.0, 0.4) << base::EnumName(law);
    EXPECT_NEAR(middle.position / fine.position, 2.0, 0.4) << base::EnumName(law);
  }
}

TEST(SkidSteeringTest, TurnsAtSpeedSlipSidewaysAndNeverBeyondFriction) {
  const RobotConfig config = Centred();
  for (const double v : {0.5, 1.0, 1.5, 2.0}) {
    for (const double w : {0.5, 1.0, 2.0, 3.0}) {
      OpenField field(config);
      field.Drive(v, w, 400);
      const double speed = field.speed(), yaw_rate = field.body().yaw_rate;
      EXPECT_LE(speed * yaw_rate, SlipLimit(config) * 1.001) << "it must be held on its circle";
      // In a steady turn forces and torque balance in the frame of the wheels, which is half a step
      // behind. Over a step the velocity there turns by w dt, whose cosine is taken for 1.
      const double yaw = field.pose().yaw - 0.5 * kDt * yaw_rate;
      const State steady = field.CentreSeenFrom(yaw);
      const double side = 0.5 * config.track * config.wheel_separation_multiplier * w;
      const State rest = Derivative(config, steady, v - side, v + side, 1e-3);
      const double tolerance = 0.5 * kDt * yaw_rate * yaw_rate * speed + 0.01;
      EXPECT_NEAR(rest.ahead, 0.0, tolerance) << v << " " << w;
      EXPECT_NEAR(rest.left, 0.0, tolerance) << v << " " << w;
      EXPECT_NEAR(rest.yaw_rate, 0.0, 0.1) << v << " " << w;
      EXPECT_LT(steady.left, 0.0) << "it drifts outwards";
    }
  }
}

double Energy(const RobotConfig& config, const BodyState& s) {
  return 0.5 *
         (config.mass * (s.vx * s.vx + s.vy * s.vy) + config.yaw_inertia * s.yaw_rate * s.yaw_rate);
}

TEST(SkidSteeringTest, StandingWheelsOnlyTakeEnergy) {
  base::Random random(2);
  for (const FrictionLaw law : kLaws) {
    for (const double dt : {0.001, 0.02, 0.1}) {
      const RobotConfig config = WithFriction(law);
      const SkidSteering skid_steering(config, dt);
      for (int round = 0; round < 300; ++round) {
        BodyVelocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                       static_cast<float>(random.Uniform(-3.0, 3.0)),
                       static_cast<float>(random.Uniform(-8.0, 8.0))};
        WheelAngles angles;
        for (float& angle : angles) angle = static_cast<float>(random.Uniform(-1.57, 1.57));
        const auto energy = [&] {
          return Energy(config, {.vx = v.ahead, .vy = v.left, .yaw_rate = v.yaw_rate});
        };
        for (int step = 0; step < 200; ++step) {
          const double before = energy();
          // Wherever the search begins.
          const BodyVelocity near{static_cast<float>(random.Uniform(-3.0, 3.0)), v.left, v.yaw_rate};
          v = skid_steering.Step(v, round % 2 == 0 ? v : near, {}, angles);
          ASSERT_LE(energy(), before * (1.0 + 1e-6)) << base::EnumName(law);
        }
        if (dt >= 0.02 && law != FrictionLaw::kGazebo) {
          EXPECT_LT(energy(), 1e-9) << "at rest within 4 s";
        }
      }
    }
  }
}

TEST(SkidSteeringTest, EnergyNeverExceedsWhatTheWheelsCommand) {
  // Friction draws the body to the velocity V at which it dissipates least, and in the kinetic norm
  // never away from it: |v - V| cannot grow, so sqrt(energy) stays below that of V plus what was
  // there.
  base::Random random(3);
  for (const FrictionLaw law : {FrictionLaw::kCone, FrictionLaw::kPyramid}) {
    const RobotConfig config = WithFriction(law);
    const SkidSteering skid_steering(config, kDt);
    for (int round = 0; round < 200; ++round) {
      const WheelSpeeds wheels =
          skid_steering.Wheels(random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14));
      BodyVelocity rest;
      for (int step = 0; step < 1000; ++step) rest = skid_steering.Step(rest, rest, wheels);
      BodyVelocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                     static_cast<float>(random.Uniform(-3.0, 3.0)),
                     static_cast<float>(random.Uniform(-6.0, 6.0))};
      const auto distance = [&] {
        return std::sqrt(Energy(config, {.vx = v.ahead - rest.ahead,
                                         .vy = v.left - rest.left,
                                         .yaw_rate = v.yaw_rate - rest.yaw_rate}));
      };
      for (int step = 0; step < 100; ++step) {
        const double before = distance();
        v = skid_steering.Step(v, v, wheels);
        ASSERT_LE(distance(), before * 1.0001 + 1e-5)
            << base::EnumName(law) << " round " << round << " step " << step;
      }
    }
  }
}

TEST(SkidSteeringTest, NoAccelerationBeyondFriction) {
  base::Random random(4);
  const RobotConfig config;
  OpenField field(config);
  double greatest = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
    for (int i = 0; i < 10; ++i) {
      const State before = field.CentreSeenFrom(0.0);
      field.Drive(v, w);
      const State after = field.CentreSeenFrom(0.0);
      const double change = std::hypot(after.ahead - before.ahead, after.left - before.left);
      greatest = std::max(greatest, change / kDt);
    }
  }
  EXPECT_GT(greatest, 0.99 * SlipLimit(config));
  EXPECT_LT(greatest, 1.01 * SlipLimit(config));
}

}  // namespace
}  // namespace slalom::sim
