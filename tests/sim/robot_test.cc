#include "sim/robot.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <thread>
#include <vector>

#include "sim/mass_distribution.h"
#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

constexpr int kSubsteps = 10;  // Of 0.02 s: control steps of 0.2 s.
constexpr double kDt = 0.02;

RobotConfig Ideal(double linear_acceleration = 20.0) {
  RobotConfig config;
  config.drive = DriveKind::kIdeal;
  config.linear_acceleration = linear_acceleration;
  return config;
}

RobotConfig Instant() {
  RobotConfig config = Ideal();
  config.linear_acceleration = 1000.0;
  config.angular_acceleration = 1000.0;
  return config;
}

/// A robot on an open field.
class OpenField {
 public:
  explicit OpenField(const RobotConfig& config) : robot_(config, kSubsteps) { robot_.Reset({}); }
  void Drive(double linear, double angular, int num_steps) {
    for (int i = 0; i < num_steps; ++i) EXPECT_FALSE(robot_.Drive(linear, angular, *scene_, 0.0));
  }
  base::Pose2 pose() const { return robot_.pose(); }
  const BodyState& body() const { return robot_.body(); }

 private:
  const std::shared_ptr<const Scene> scene_ = MakeScene(std::make_shared<const Course>());
  Robot robot_;
};

TEST(RobotTest, SpeedsUpEvenlyAndThenHoldsItsSpeed) {
  OpenField field(Ideal(4.0));
  field.Drive(1.0, 0.0, 5);
  // Speeds 0.08, 0.16, ... 0.96 m/s in twelve rigid-body steps, then 1 m/s in 38.
  EXPECT_NEAR(field.pose().p.x, kDt * (0.08 * 12 * 13 / 2 + 38 * 1.0), 1e-5);
  EXPECT_EQ(field.pose().p.y, 0.0);
  EXPECT_EQ(field.pose().yaw, 0.0);
}

TEST(RobotTest, BrakesWithinItsBrakingDistance) {
  OpenField field(Ideal(4.0));
  field.Drive(2.0, 0.0, 10);
  const double start = field.pose().p.x;
  field.Drive(0.0, 0.0, 10);
  // v^2 / 2a = 0.5 m, less half a rigid-body step of 2 m/s, as a step moves at the speed of its
  // end.
  EXPECT_NEAR(field.pose().p.x - start, 0.5 - 0.5 * kDt * 2.0, 1e-5);
  EXPECT_EQ(field.body().vx, 0.0f);
}

TEST(RobotTest, TurnsOnTheSpot) {
  OpenField field(Instant());
  field.Drive(0.0, 1.0, 5);
  EXPECT_NEAR(field.pose().yaw, 1.0, 1e-5);
  EXPECT_EQ(field.pose().p, base::Vec2{});
  field.Drive(0.0, 1.0, 20);
  EXPECT_NEAR(field.pose().yaw, 5.0 - 2.0 * base::kPi, 1e-5) << "in [-pi, pi)";
}

TEST(RobotTest, DrivesAnArc) {
  OpenField field(Instant());
  const double v = 1.5, w = 2.0;
  field.Drive(v, w, 6);
  const double angle = 1.2 * w;
  // A chord is shorter than its arc by (w dt)^2 / 24 = 7e-5 of it, for any part of the circle.
  EXPECT_NEAR(field.pose().p.x, v / w * std::sin(angle), v / w * 1e-4);
  EXPECT_NEAR(field.pose().p.y, v / w * (1.0 - std::cos(angle)), 2 * v / w * 1e-4);
  EXPECT_NEAR(field.pose().yaw, angle, 1e-5);
}

TEST(RobotTest, KeepsToItsSpeedLimitsAndYawGain) {
  RobotConfig config = Instant();
  config.yaw_gain = 0.8;
  OpenField field(config);
  field.Drive(9.0, 9.0, 1);
  EXPECT_FLOAT_EQ(std::hypot(field.body().vx, field.body().vy), 2.0f);
  EXPECT_FLOAT_EQ(field.body().yaw_rate, 0.8 * 4.0);
  field.Drive(-9.0, -9.0, 1);
  EXPECT_FLOAT_EQ(std::hypot(field.body().vx, field.body().vy), 2.0f);
  EXPECT_FLOAT_EQ(field.body().yaw_rate, -0.8 * 4.0);
}

TEST(RobotTest, ActsOnCommandsAfterTheirDelay) {
  for (const double delay : {0.0, 0.04, 0.2, 0.26, 0.5, 1.0}) {
    RobotConfig config = Instant();
    config.command_delay = delay;
    OpenField field(config);
    // One step of 1 m/s between standing: 0.2 m in all, whenever it comes.
    field.Drive(0.0, 0.0, 1);
    field.Drive(1.0, 0.0, 1);
    EXPECT_NEAR(field.pose().p.x, std::max(0.0, 0.2 - delay), 1e-6) << delay;
    field.Drive(0.0, 0.0, 6);
    EXPECT_NEAR(field.pose().p.x, 0.2, 1e-6) << delay;
  }
}

TEST(RobotTest, JitterDelaysEachCommandButLetsNoneOvertake) {
  for (const double jitter : {0.1, 0.3, 0.9}) {
    RobotConfig config = Instant();
    config.command_delay = 0.06;
    config.command_jitter = jitter;
    constexpr int kSteps = 300;
    constexpr std::uint64_t kSeed = 77;
    const Scene scene(std::make_shared<const Course>());
    Robot robot(config, kSubsteps);
    robot.Reset({}, kSeed);
    // The oracle: when each command arrives, and which arrived last at every rigid-body step.
    base::Random draws(kSeed), random(5);
    std::vector<double> speeds;
    std::vector<int> arrivals;
    double x = 0.0;
    int late = 0;
    for (int step = 0; step < kSteps; ++step) {
      speeds.push_back(random.Uniform(-1.0, 1.0));
      const int lag = static_cast<int>(std::lround((0.06 + draws.Uniform(0.0, jitter)) / kDt));
      const int arrival = step * kSubsteps + lag;
      late += !arrivals.empty() && arrivals.back() > arrival;
      arrivals.push_back(arrivals.empty() ? arrival : std::max(arrival, arrivals.back()));
      for (int substep = 0; substep < kSubsteps; ++substep) {
        double speed = 0.0;
        for (int k = 0; k <= step; ++k) {
          if (arrivals[k] <= step * kSubsteps + substep) speed = speeds[k];
        }
        x += kDt * speed;
      }
      robot.Drive(speeds.back(), 0.0, scene, 0.0);
      ASSERT_NEAR(robot.pose().p.x, x, 1e-4) << "step " << step;
    }
    EXPECT_EQ(late > 0, jitter > 0.2) << "only then can commands queue up";
  }
}

TEST(RobotTest, GainsAndImbalanceChangeWhatIsAskedOfTheWheels) {
  RobotConfig config = Instant();
  config.speed_gain = 0.9;
  OpenField field(config);
  field.Drive(1.0, 0.0, 5);
  EXPECT_NEAR(field.pose().p.x, 0.9, 1e-5);

  // Wheels 4 % apart at 1 m/s and 2 rad/s do what even wheels do at these speeds.
  RobotConfig uneven;
  uneven.wheel_imbalance = 0.04;
  const double separation = uneven.track * uneven.wheel_separation_multiplier;
  const WheelSpeeds asked = SkidSteering(uneven, kDt).Wheels(1.0, 2.0);
  const WheelSpeeds same =
      SkidSteering(RobotConfig{}, kDt)
          .Wheels(1.0 + 0.02 * 0.5 * separation * 2.0, 2.0 + 0.04 * 1.0 / separation);
  EXPECT_NEAR(asked.left, same.left, 1e-6);
  EXPECT_NEAR(asked.right, same.right, 1e-6);
  OpenField drifting(uneven);
  drifting.Drive(1.0, 0.0, 10);
  EXPECT_GT(drifting.pose().yaw, 0.05) << "to the side of the slower wheels";
}

TEST(RobotTest, RobotsDriveTogetherAsEachDoesAlone) {
  base::Random random(9);
  for (const char* law : {"cone", "pyramid", "gazebo"}) {
    RobotConfig config;
    ASSERT_TRUE(base::ParseEnum(law, config.friction));
    const Scene scene(test::RandomCourse(random, {.num_circles = 40, .num_boxes = 5}));
    constexpr int kCount = 19;  // Two groups of lanes and a part of one.
    std::vector<Robot> together(kCount, Robot(config, kSubsteps)), alone = together;
    for (int i = 0; i < kCount; ++i) {
      const base::Pose2 X_WR{{random.Uniform(-4.0, 4.0), random.Uniform(-4.0, 4.0)},
                             random.Uniform(-3.0, 3.0)};
      together[i].Reset(X_WR, i);
      alone[i].Reset(X_WR, i);
    }
    int touched = 0;
    for (int step = 0; step < 40; ++step) {
      std::vector<Robot::Order> orders(kCount);
      for (int i = 0; i < kCount; ++i) {
        orders[i] = {.robot = &together[i],
                     .scene = &scene,
                     .linear = random.Uniform(-1.0, 2.0),
                     .angular = random.Uniform(-3.0, 3.0)};
      }
      orders.front().robot->DriveTogether(orders);
      for (int i = 0; i < kCount; ++i) {
        const bool alone_touched = alone[i].Drive(orders[i].linear, orders[i].angular, scene, 0.0);
        ASSERT_EQ(orders[i].touched, alone_touched);
        ASSERT_EQ(together[i].body(), alone[i].body()) << law << " robot " << i;
        touched += alone_touched;
      }
    }
    EXPECT_GT(touched, 20);
    EXPECT_LT(touched, 700);
  }
}

TEST(RobotTest, PushesAgainstAWallWithoutPassingOrGainingEnergy) {
  for (const double yaw : {0.0, 0.3, -0.7}) {
    Course course;
    course.boxes = {{{{1.5, 0.0}, 0.0}, {0.05, 20.0}}};
    const Scene scene(std::make_shared<const Course>(course));
    const RobotConfig config;
    Robot robot(config, kSubsteps);
    robot.Reset({{0.0, 0.0}, yaw});
    bool touched = false;
    for (int i = 0; i < 50; ++i) {
      touched = robot.Drive(2.0, 0.0, scene, 0.0) || touched;
      const BodyState& body = robot.body();
      EXPECT_LE(std::hypot(body.vx, body.vy), 2.0 + 1e-5);
      EXPECT_LT(body.x, 1.45 - 0.208 + 0.08) << "its nearest side is not 0.08 m into the wall";
    }
    EXPECT_TRUE(touched);
  }
}

TEST(ContactWorldTest, ContactTakesKineticEnergy) {
  base::Random random(5);
  RobotConfig config;
  config.centre_of_mass_x = 0.05;
  config.centre_of_mass_y = -0.03;
  const MassDistribution masses = DistributeMass(config);
  const auto energy = [&](const BodyState& s) {
    return 0.5 * config.mass * (s.vx * s.vx + s.vy * s.vy) +
           0.5 * config.yaw_inertia * s.yaw_rate * s.yaw_rate;
  };
  ContactWorld contacts(config);
  int touched = 0;
  for (int round = 0; round < 500; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 40, .num_boxes = 5});
    const CollisionMap map(*course);
    BodyState state{.x = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .y = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .yaw = static_cast<float>(random.Uniform(-3.0, 3.0)),
                    .vx = static_cast<float>(random.Uniform(-2.0, 2.0)),
                    .vy = static_cast<float>(random.Uniform(-2.0, 2.0)),
                    .yaw_rate = static_cast<float>(random.Uniform(-4.0, 4.0))};
    const base::Vec2 middle =  // What `state` is of lies ahead of it.
        base::Transform({{state.x, state.y}, state.yaw}, {-masses.x, -masses.y});
    const float clearance = map.Clearance(MakeFootprint(config), static_cast<float>(middle.x),
                                          static_cast<float>(middle.y), state.yaw, 0.1f);
    const double before = energy(state);
    const bool touching = contacts.Step(map, {}, 0.02f, state);
    // Box2D's rounding near 4 m: some 1e-6 m.
    if (std::abs(clearance) > 1e-5f) EXPECT_EQ(touching, clearance < 0.0f) << clearance;
    EXPECT_LE(energy(state), before * (1.0 + 1e-5));
    touched += touching;
  }
  EXPECT_GT(touched, 100);
}

TEST(ContactWorldTest, RemembersNothing) {
  base::Random random(6);
  const RobotConfig config;
  ContactWorld used(config);
  int touched = 0;
  for (int round = 0; round < 300; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 60, .num_boxes = 10});
    const CollisionMap map(*course);
    BodyState state{.x = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .y = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .vx = 1.0f,
                    .yaw_rate = static_cast<float>(random.Uniform(-4.0, 4.0))};
    for (int step = 0; step < 3; ++step) {
      BodyState again = state;
      ContactWorld fresh(config);
      touched += used.Step(map, {}, 0.02f, state);
      fresh.Step(map, {}, 0.02f, again);
      ASSERT_EQ(state, again) << "round " << round;
    }
  }
  EXPECT_GT(touched, 300);
}

// A sum of what 3,000 steps against random obstacles leave of the robot's state.
double PushAround(ContactWorld& contacts, std::uint64_t seed) {
  base::Random random(seed);
  const auto course = test::RandomCourse(random, {.num_circles = 60, .num_boxes = 10});
  const CollisionMap map(*course);
  double sum = 0.0;
  for (int step = 0; step < 3000; ++step) {
    BodyState state{.x = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .y = static_cast<float>(random.Uniform(-4.0, 4.0)),
                    .vx = 1.0f};
    contacts.Step(map, {}, 0.02f, state);
    sum += state.x + state.y + state.vx + state.vy + state.yaw_rate;
  }
  return sum;
}

TEST(ContactWorldTest, ServesSeveralThreadsAtTheSameTime) {
  constexpr int kThreads = 4;
  ContactWorld shared({});
  std::array<double, kThreads> sums{};
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&, i] { sums[i] = PushAround(shared, i); });
    }
  }
  for (int i = 0; i < kThreads; ++i) {
    ContactWorld own({});
    EXPECT_EQ(sums[i], PushAround(own, i)) << "thread " << i;
  }
}

}  // namespace
}  // namespace slalom::sim
