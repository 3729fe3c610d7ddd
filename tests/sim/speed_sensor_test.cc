#include "sim/speed_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "sim/courses/course_sets.h"
#include "sim/environments.h"

namespace slalom::sim {
namespace {

constexpr double kStep = 0.2;  // [s]

Speeds At(int step) { return {0.1 * step * step, std::sin(0.3 * step)}; }

TEST(SpeedSensor, WithoutDelayAndNoiseTellsTheOdometry) {
  SpeedSensor sensor({}, kStep);
  sensor.Reset(1);
  for (int step = 0; step < 10; ++step) EXPECT_EQ(sensor.Observe(At(step)), At(step));
}

// The oracle interpolates between all that was given; before the episode the robot stood.
TEST(SpeedSensor, DelayedSpeedsAreInterpolatedBetweenSteps) {
  for (const double delay : {0.05, 0.2, 0.3, 0.4, 1.0, 1.01, 2.0}) {
    LocalisationConfig config;
    config.speed_delay = delay;
    SpeedSensor sensor(config, kStep);
    for (int episode = 0; episode < 2; ++episode) {
      sensor.Reset(1);
      for (int step = 0; step < 15; ++step) {
        const Speeds found = sensor.Observe(At(step));
        const double time = step - delay / kStep;
        const auto before = static_cast<int>(std::floor(time + 1e-12));
        const double share = time - before;
        const Speeds low = before >= 0 ? At(before) : Speeds{};
        const Speeds high = before + 1 >= 0 ? At(before + 1) : Speeds{};
        EXPECT_NEAR(found.forward, (1.0 - share) * low.forward + share * high.forward, 1e-9)
            << delay << " s at step " << step;
        EXPECT_NEAR(found.turn_rate, (1.0 - share) * low.turn_rate + share * high.turn_rate, 1e-9);
      }
    }
  }
}

TEST(SpeedSensor, NoiseHasItsDeviationsAndFollowsFromTheSeed) {
  LocalisationConfig config;
  config.speed_noise = 0.2;
  config.turn_rate_noise = 0.5;
  SpeedSensor sensor(config, kStep), same(config, kStep), other(config, kStep);
  sensor.Reset(3);
  same.Reset(3);
  other.Reset(4);
  constexpr int kNumDraws = 20000;
  double sum = 0.0, squares = 0.0, turn_squares = 0.0, products = 0.0;
  int num_equal = 0;
  for (int i = 0; i < kNumDraws; ++i) {
    const Speeds found = sensor.Observe({1.0, -2.0});
    EXPECT_EQ(same.Observe({1.0, -2.0}), found);
    num_equal += other.Observe({1.0, -2.0}) == found ? 1 : 0;
    const double error = found.forward - 1.0, turn_error = found.turn_rate + 2.0;
    sum += error;
    squares += error * error;
    turn_squares += turn_error * turn_error;
    products += error * turn_error;
  }
  // Five standard errors: 5 / sqrt(20000) = 0.035 of the deviation, sqrt(2) of that for a variance.
  EXPECT_NEAR(sum / kNumDraws, 0.0, 0.035 * 0.2);
  EXPECT_NEAR(squares / kNumDraws, 0.04, 0.05 * 0.04);
  EXPECT_NEAR(turn_squares / kNumDraws, 0.25, 0.05 * 0.25);
  EXPECT_NEAR(products / kNumDraws, 0.0, 0.035 * 0.1);
  EXPECT_EQ(num_equal, 0);
}

/// Environments with these settings, all on one course.
CourseEnvironments Make(const EnvironmentConfig& config, int batch = 1) {
  return CourseEnvironments(config, MakeScenes(ResolveCourses("generated:3:1", std::nullopt, 0)),
                            batch, nullptr);
}

env::Action ActionOf(int step) {
  return {static_cast<float>(0.1 + 0.02 * step), static_cast<float>(std::sin(0.7 * step))};
}

TEST(EnvironmentsTest, SpeedsAndCommandsFollowTheGoalAndTheLastCommand) {
  EnvironmentConfig config;
  config.observation.speeds = true;
  config.observation.commands = 3;
  CourseEnvironments plain = Make({}), more = Make(config);
  ASSERT_EQ(plain.shape(), env::StepShape(720, 4));
  ASSERT_EQ(more.shape(), env::StepShape(720, 10));
  EXPECT_EQ(MakeObservationSpec(config).state_size, 10);
  std::vector<env::StepResult> results(1);
  for (std::uint64_t seed = 0; seed < 2; ++seed) {
    plain.Reset(0, {0, seed});
    more.Reset(0, {0, seed});
    std::vector<env::Action> given(3, config.action.Normalise(0.0, 0.0));  // The newest last.
    for (int step = 0; step < 12; ++step) {
      const env::FrameView few = plain.observations().frame(0), many = more.observations().frame(0);
      EXPECT_TRUE(std::ranges::equal(few.ranges_cm, many.ranges_cm));
      EXPECT_TRUE(std::ranges::equal(few.state, many.state.first(4))) << "the episode is the same";
      const env::Odometry& odometry = plain.observations().odometry[0];
      EXPECT_NEAR(config.action.linear_mps({many.state[4], 0.0f}), odometry.linear, 1e-6);
      EXPECT_NEAR(config.action.angular_radps({0.0f, many.state[5]}), odometry.angular, 1e-6);
      const std::size_t n = given.size();
      EXPECT_EQ((env::Action{many.state[2], many.state[3]}), given[n - 1]);
      EXPECT_EQ((env::Action{many.state[6], many.state[7]}), given[n - 2]);
      EXPECT_EQ((env::Action{many.state[8], many.state[9]}), given[n - 3]);
      given.push_back(ActionOf(step));
      const std::vector<env::Action> action = {ActionOf(step)};
      plain.Step(env::NumbersOf(action), results);
      more.Step(env::NumbersOf(action), results);
      if (results[0].ended()) break;
    }
    EXPECT_GT(given.size(), 7u);
  }
}

TEST(EnvironmentsTest, TheMountingIsThatOfTheEpisode) {
  EnvironmentConfig config;
  config.observation.speeds = true;
  config.observation.mounting = true;
  config.observation.commands = 2;
  config.lidar.offset_y = 0.03;
  config.randomize = {{"lidar.offset_x", {"[-0.1, 0.15]", ""}}};
  CourseEnvironments drawn = Make(config);
  ASSERT_EQ(drawn.shape(), env::StepShape(720, 10));
  std::set<float> seen;
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    drawn.Reset(0, {0, seed});
    const env::FrameView frame = drawn.observations().frame(0);
    EXPECT_EQ(frame.state[7], 0.3f);
    EXPECT_GE(frame.state[6], -1.0f);
    EXPECT_LE(frame.state[6], 1.5f);
    seen.insert(frame.state[6]);
    // The frame is that of a robot with this mounting.
    EnvironmentConfig fixed = config;
    fixed.randomize.clear();
    fixed.lidar.offset_x = static_cast<double>(frame.state[6]) / 10.0;
    CourseEnvironments same = Make(fixed);
    same.Reset(0, {0, seed});
    EXPECT_TRUE(std::ranges::equal(same.observations().frame(0).state, frame.state));
  }
  EXPECT_EQ(seen.size(), 5u);
}

/// Robots that are drawn, with privileged fields.
EnvironmentConfig PrivilegedConfig() {
  EnvironmentConfig config;
  config.observation.commands = 2;
  config.observation.privileged = true;
  config.randomize = {{"robot.command_delay", {"[0.0, 0.12]", ""}},
                      {"robot.linear_acceleration", {"[2.0, 20.0]", ""}}};
  return config;
}

TEST(EnvironmentsTest, PrivilegedNumbersAreTheNearestObstaclesAndTheDrive) {
  CourseEnvironments environments(
      PrivilegedConfig(), MakeScenes(ResolveCourses("generated-crowds:3:2", {}, 0)), 1, nullptr);
  ASSERT_EQ(environments.shape(), env::StepShape(720, 6 + env::kPrivilegedSize));
  std::vector<env::StepResult> results(1);
  int num_compared = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    environments.Reset(0, {static_cast<int>(seed % 2), seed});
    const MovingObstacles& moving = environments.scene(0).moving_obstacles();
    ASSERT_GT(moving.size(), 1);
    for (int step = 0; step < 10; ++step) {
      const base::Pose2 X_WR = environments.robot_pose(0);
      // All obstacles by their distance, velocities by differences of places.
      std::map<double, std::array<double, 4>> all;
      for (int i = 0; i < moving.size(); ++i) {
        constexpr double kDelta = 1e-2;
        const double t = environments.motion_time(0);
        if (moving.Jumps(i, t - kDelta, 2.0 * kDelta)) continue;
        const auto at = [&](double time) {
          const MovingShape shape = moving.At(i, time);
          return base::Vec2{shape.box.x, shape.box.y};
        };
        const base::Vec2 place = base::InverseTransform(X_WR, at(t));
        const base::Vec2 moved = base::InverseTransform(X_WR, at(t + kDelta)) -
                                 base::InverseTransform(X_WR, at(t - kDelta));
        all[base::Norm(place) - static_cast<double>(moving.circumradius(i))] = {
            place.x, place.y, moved.x / (2.0 * kDelta), moved.y / (2.0 * kDelta)};
      }
      const auto state = environments.observations().frame(0).state.last(env::kPrivilegedSize);
      const env::Action speeds =
          PrivilegedConfig().action.Scale(environments.observations().odometry[0].linear,
                                          environments.observations().odometry[0].angular);
      EXPECT_EQ((env::Action{state[0], state[1]}), speeds);
      std::size_t k = 2;
      if (std::ssize(all) == moving.size()) {
        for (const auto& [distance, obstacle] : all) {
          if (k == 2 + 4 * env::kObservedObstacles) break;
          EXPECT_NEAR(5.0f * state[k], obstacle[0], 1e-4);
          EXPECT_NEAR(5.0f * state[k + 1], obstacle[1], 1e-4);
          EXPECT_NEAR(state[k + 2], obstacle[2], 0.02);
          EXPECT_NEAR(state[k + 3], obstacle[3], 0.02);
          k += 4;
          ++num_compared;
        }
        for (; k < 2 + 4 * env::kObservedObstacles; ++k) EXPECT_EQ(state[k], 0.0f);
      }
      const auto drive = state.last(6);
      EXPECT_GE(drive[0], 0.0f);
      EXPECT_LE(drive[0], 1.2f);
      EXPECT_EQ(drive[2], 0.0f);
      EXPECT_GE(drive[4], 0.1f);
      EXPECT_LE(drive[4], 1.0f);
      EXPECT_EQ(drive[5], 1.0f);
      const std::vector<env::Action> action = {ActionOf(step)};
      environments.Step(env::NumbersOf(action), results);
      if (results[0].ended()) break;
    }
  }
  EXPECT_GT(num_compared, 50);
}

TEST(EnvironmentsTest, PrivilegedNumbersComeLastAndChangeNothingElse) {
  EnvironmentConfig less = PrivilegedConfig();
  less.observation.privileged = false;
  const auto scenes = MakeScenes(ResolveCourses("generated-crowds:3:2", {}, 0));
  CourseEnvironments environments(PrivilegedConfig(), scenes, 1, nullptr),
      plain(less, scenes, 1, nullptr);
  std::vector<env::StepResult> results(1);
  environments.Reset(0, {1, 5});
  plain.Reset(0, {1, 5});
  for (int step = 0; step < 5; ++step) {
    const env::FrameView more = environments.observations().frame(0),
                         few = plain.observations().frame(0);
    EXPECT_TRUE(std::ranges::equal(more.ranges_cm, few.ranges_cm));
    EXPECT_TRUE(std::ranges::equal(more.state.first(few.state.size()), few.state));
    const std::vector<env::Action> action = {ActionOf(step)};
    environments.Step(env::NumbersOf(action), results);
    plain.Step(env::NumbersOf(action), results);
  }
}

// With a range finder that is drawn, too, tracks are those of a tracker that reads what the robot
// is shown, and a second episode knows nothing of the first.
TEST(EnvironmentsTest, TrackedNumbersAreThoseOfATrackerOfTheFrames) {
  EnvironmentConfig config;
  config.observation.tracked = true;
  config.randomize = {{"lidar.offset_x", {"[-0.2, 0.2]", ""}}};
  config.observation.mounting = true;
  CourseEnvironments environments(config, MakeScenes(ResolveCourses("generated-crowds:3:2", {}, 0)),
                                  1, nullptr);
  std::vector<env::StepResult> results(1);
  const std::size_t place = env::StateSize({.mounting = true});
  int num_tracks = 0, num_far = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    environments.Reset(0, {static_cast<int>(seed % 2), seed});
    EnvironmentConfig drawn = config;
    drawn.lidar.offset_x = static_cast<double>(environments.observations().state[4]) / 10.0;
    env::ObstacleTracker tracker(ScanGeometryOf(drawn), config.episode.step);
    const MovingObstacles& moving = environments.scene(0).moving_obstacles();
    for (int step = 0; step < 10; ++step) {
      const env::FrameView frame = environments.observations().frame(0);
      const base::Pose2& X_OR = environments.observations().odometry[0].X_OR;
      tracker.Update(frame.ranges_cm, X_OR);
      const auto tracked = frame.state.subspan(place, 4 * env::kObservedObstacles);
      for (std::size_t k = 0; k < env::kObservedObstacles; ++k) {
        const auto seen = tracked.subspan(4 * k, 4);
        if (k >= tracker.tracks().size()) {
          EXPECT_THAT(seen, testing::Each(0.0f));
          continue;
        }
        const env::Track& track = tracker.tracks()[k];
        const base::Vec2 p_O = base::Transform(X_OR, {5.0 * seen[0], 5.0 * seen[1]});
        const base::Vec2 v_O = base::Transform({{}, X_OR.yaw}, {seen[2], seen[3]});
        EXPECT_NEAR(base::Norm(p_O - track.p_O), 0.0, 2e-3);
        EXPECT_NEAR(base::Norm(v_O - track.v_O), 0.0, 1e-4);
        // What is tracked is there.
        double nearest = 1e9;
        for (int i = 0; i < moving.size(); ++i) {
          const MovingShape shape = moving.At(i, environments.motion_time(0));
          const base::Vec2 p_R =
              base::InverseTransform(environments.robot_pose(0), {shape.box.x, shape.box.y});
          nearest = std::min(nearest, base::Norm(p_R - base::Vec2{5.0 * seen[0], 5.0 * seen[1]}));
        }
        ++num_tracks;
        num_far += nearest > 0.5;
      }
      const std::vector<env::Action> action = {ActionOf(step)};
      environments.Step(env::NumbersOf(action), results);
      if (results[0].ended()) break;
    }
  }
  EXPECT_GT(num_tracks, 20);
  EXPECT_LE(num_far, num_tracks / 5);
}

TEST(EnvironmentsTest, ObservedSpeedsHaveTheirNoiseAndNothingElseChanges) {
  EnvironmentConfig config;
  config.observation.speeds = true;
  config.localisation.speed_delay = 0.1;
  EnvironmentConfig noisy = config;
  noisy.localisation.speed_noise = 0.1;
  CourseEnvironments calm = Make(config), wild = Make(noisy);
  std::vector<env::StepResult> results(1);
  calm.Reset(0, {0, 5});
  wild.Reset(0, {0, 5});
  double last = 0.0;
  for (int step = 0; step < 8; ++step) {
    const auto a = calm.observations().frame(0).state, b = wild.observations().frame(0).state;
    EXPECT_TRUE(std::ranges::equal(a.first(4), b.first(4)));
    EXPECT_NE(a[4], b[4]);
    EXPECT_EQ(a[5], b[5]);
    // Half a step ago: the mean of the last two.
    const double now = calm.observations().odometry[0].linear;
    EXPECT_NEAR(config.action.linear_mps({a[4], 0.0f}), 0.5 * (now + last), 1e-6);
    last = now;
    const std::vector<env::Action> action = {ActionOf(step)};
    calm.Step(env::NumbersOf(action), results);
    wild.Step(env::NumbersOf(action), results);
  }
}

}  // namespace
}  // namespace slalom::sim
