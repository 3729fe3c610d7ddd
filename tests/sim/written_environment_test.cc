#include "tests/sim/written_environment.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "sim/courses/dynamic_generator.h"
#include "sim/environments.h"
#include "tests/support/random_courses.h"

/// Holds the environments to the task as it is written down, and their random streams to what the
/// settings say of them. What `EnvironmentsDeterminismTest.GoldenHash` pins bit for bit is held
/// here to what it should be, so that a fault cannot pass with a new hash.

namespace slalom::sim {
namespace {

using env::Outcome;

/// The course with its goal so near that a robot which drives about may reach it.
std::shared_ptr<const Scene> WithGoalNear(Course course, base::Vec2 goal_R) {
  course.goal_W = base::Transform(course.start, goal_R);
  return MakeScene(std::make_shared<const Course>(std::move(course)));
}

/// Static, box and wall courses.
std::vector<std::shared_ptr<const Scene>> Scenes() {
  base::Random random(5);
  std::vector<std::shared_ptr<const Scene>> scenes;
  for (int i = 0; i < 3; ++i) {
    scenes.push_back(WithGoalNear(*test::RandomCourse(random), {1.4, 0.2}));
    scenes.push_back(WithGoalNear(*test::RandomCourse(random, {.num_circles = 10, .num_boxes = 12}),
                                  {1.2, 0.0}));
    scenes.push_back(WithGoalNear(
        *test::WithMoving(*test::RandomCourse(random, {.num_circles = 5}), 5, random), {1.4, 0.0}));
  }
  for (const auto& course : GenerateBoxCourses(1, 0, 3).courses) {
    scenes.push_back(WithGoalNear(*course, {1.6, -0.2}));
  }
  for (const auto& course : GenerateWallCourses(1, 0, 3).courses) {
    scenes.push_back(WithGoalNear(*course, {1.6, 0.2}));
  }
  return scenes;
}

/// Control steps of one rigid-body step, so that poses tell all contacts.
EnvironmentConfig OneRigidBodyStep() {
  EnvironmentConfig config;
  config.robot.control_rate = 25.0;
  config.episode.step = 0.04;
  config.episode.max_steps = 60;
  config.lidar.num_beams = 73;
  config.lidar.noise_std = 0.0;
  return config;
}

/// All that the oracle reads is set to something other than the default.
EnvironmentConfig OtherSettings() {
  EnvironmentConfig config = OneRigidBodyStep();
  config.robot.drive = DriveKind::kIdeal;
  config.robot.linear_acceleration = config.robot.angular_acceleration = 1000.0;
  config.robot.length = 0.5;
  config.robot.width = 0.38;
  config.robot.linear_speed_limit = 5.0;
  config.robot.angular_speed_limit = 10.0;
  config.lidar.field_of_view = 6.0;
  config.lidar.offset_x = -0.05;
  config.lidar.offset_y = 0.04;
  config.lidar.min_range = 0.3;
  config.lidar.max_range = 3.5;
  config.lidar.resolution = 0.05;
  config.lidar.noise_std = 0.02;
  config.lidar.noise_per_metre = 0.01;
  config.observation.range_clip = 3.0;
  config.action = {.linear_min = -0.5, .linear_max = 2.4, .angular_max = 2.5};
  config.reward = {.success = 7.0, .progress = 2.0, .collision = 1.5, .slack = 0.1, .timeout = 3.0};
  config.episode.goal_tolerance = 0.3;
  config.episode.finish_ahead = 1.5;
  config.episode.look_period = 1.2;  // Twice in an episode, the second time in its last step.
  config.episode.start_position_jitter = 0.2;
  config.episode.start_yaw_jitter = 0.5;
  return config;
}

EnvironmentConfig Scraping(EnvironmentConfig config) {
  config.episode.collision_ends = false;
  return config;
}

// Positions are single precision, 2^-24 of 16 m: 1e-6 m. A frame's state has as many digits.
constexpr double kRounding = 5e-6;

void ExpectFrame(const EnvironmentConfig& config, const WrittenEpisode& written,
                 const env::ObservationBatch& observations, int i) {
  const env::FrameView frame = observations.frame(i);
  EXPECT_NEAR(frame.state[0], written.goal_R().x, kRounding);
  EXPECT_NEAR(frame.state[1], written.goal_R().y, kRounding);
  EXPECT_NEAR(frame.state[2], written.last_linear(), 1e-6);
  EXPECT_NEAR(frame.state[3], written.last_angular(), 1e-6);
  const base::Pose2 X_OR = observations.odometry[i].X_OR;
  EXPECT_NEAR(X_OR.p.x, written.X_OR().p.x, 1e-9);
  EXPECT_NEAR(X_OR.p.y, written.X_OR().p.y, 1e-9);
  EXPECT_NEAR(std::remainder(X_OR.yaw - written.X_OR().yaw, 2.0 * base::kPi), 0.0, 1e-9);
  const std::vector<Bracket> ranges = written.Ranges();
  ASSERT_EQ(frame.ranges_cm.size(), ranges.size());
  // Noise never exceeds four standard deviations.
  const auto noise = [&](double range) {
    return 4.0 * (config.lidar.noise_std + config.lidar.noise_per_metre * range);
  };
  for (std::size_t beam = 0; beam < ranges.size(); ++beam) {
    const auto [low, high] = ranges[beam];
    EXPECT_GE(frame.ranges_cm[beam], written.Reported(low - noise(low))) << "beam " << beam;
    EXPECT_LE(frame.ranges_cm[beam], written.Reported(high + noise(high))) << "beam " << beam;
  }
}

/// What `Drive` has seen.
struct Tally {
  int steps = 0, contacts = 0, unclear = 0;
  int last_successes = 0;         // In the last step that there may be.
  std::array<int, 4> outcomes{};  // By `env::Outcome`.
};

/// Drives about at random, mostly ahead, on all courses side by side, and holds each step to the
/// oracle. Ends at the first that differs.
Tally Drive(const EnvironmentConfig& config, int rounds) {
  const auto scenes = Scenes();
  const int batch_size = static_cast<int>(scenes.size());
  CourseEnvironments environments(config, scenes, batch_size, nullptr);
  base::Random random(6);
  Tally tally;
  std::vector<env::Action> actions(batch_size);
  std::vector<env::StepResult> results(batch_size);
  for (int round = 0; round < rounds; ++round) {
    std::vector<WrittenEpisode> written;
    for (int i = 0; i < batch_size; ++i) {
      environments.Reset(i, {i, static_cast<std::uint64_t>(100 * round + i)});
      const Course& course = scenes[i]->course();
      const base::Pose2 start = environments.robot_pose(i);
      const double time = environments.motion_time(i);
      const auto& episode = written.emplace_back(config, course, start, time);
      EXPECT_LE(std::abs(start.p.x - course.start.p.x),
                config.episode.start_position_jitter + kRounding);
      EXPECT_LE(std::abs(start.p.y - course.start.p.y),
                config.episode.start_position_jitter + kRounding);
      EXPECT_LE(std::abs(std::remainder(start.yaw - course.start.yaw, 2.0 * base::kPi)),
                config.episode.start_yaw_jitter + 1e-6);
      EXPECT_EQ(episode.Touches().low, 0.0);
      EXPECT_TRUE(course.moving.empty() ? time == 0.0 : 0.0 < time && time < 1000.0) << time;
      ExpectFrame(config, episode, environments.observations(), i);
      EXPECT_EQ(environments.observations().first[i], 1);
      EXPECT_EQ(environments.observations().ended[i], 0);
      results[i] = {};
    }
    for (int step = 0; step < config.episode.max_steps; ++step) {
      // Held for a while, or it would stay where it is. A quarter is beyond [-1, 1].
      if (step % 8 == 0) {
        for (env::Action& action : actions) {
          action = {static_cast<float>(random.Uniform(-0.4, 1.2)),
                    static_cast<float>(random.Uniform(-1.2, 1.2))};
        }
      }
      const std::vector<env::StepResult> before = results;
      environments.Step(env::NumbersOf(actions), results);
      for (int i = 0; i < batch_size; ++i) {
        if (before[i].ended()) continue;
        SCOPED_TRACE(testing::Message() << "round " << round << ", step " << step << ", course "
                                        << scenes[i]->course().name << " (" << i << ")");
        const base::Pose2 X_WR = environments.robot_pose(i);
        const bool touched = results[i].cost == 1.0f;
        const Bracket begins = written[i].Touches();
        const base::Pose2 ideal = written[i].AfterIdealStep(actions[i]);
        const env::StepResult expected = written[i].Step(actions[i], X_WR, touched);
        const Bracket ends = written[i].Touches();
        EXPECT_GE(results[i].cost, std::max(begins.low, ends.low));
        EXPECT_LE(results[i].cost, std::max(begins.high, ends.high));
        EXPECT_EQ(results[i].cost, expected.cost);
        EXPECT_EQ(results[i].outcome, expected.outcome);
        EXPECT_NEAR(results[i].reward, expected.reward, 2e-6) << "below 32, 2^-24 of it";
        EXPECT_DOUBLE_EQ(environments.motion_time(i), written[i].motion_time());
        EXPECT_EQ(environments.observations().first[i], 0);
        EXPECT_EQ(environments.observations().ended[i], results[i].ended() ? 1 : 0);
        ExpectFrame(config, written[i], environments.observations(), i);
        if (config.robot.drive == DriveKind::kIdeal && begins.high == 0.0) {
          EXPECT_NEAR(X_WR.p.x, ideal.p.x, kRounding);
          EXPECT_NEAR(X_WR.p.y, ideal.p.y, kRounding);
          EXPECT_NEAR(std::remainder(X_WR.yaw - ideal.yaw, 2.0 * base::kPi), 0.0, 1e-6);
        }
        if (testing::Test::HasFailure()) return tally;
        ++tally.steps;
        tally.contacts += touched;
        tally.unclear += begins.low != begins.high || ends.low != ends.high;
        tally.last_successes +=
            results[i].outcome == Outcome::kSuccess && step + 1 == config.episode.max_steps;
        ++tally.outcomes[static_cast<std::size_t>(results[i].outcome)];
      }
    }
  }
  return tally;
}

int Num(const Tally& tally, Outcome outcome) {
  return tally.outcomes[static_cast<std::size_t>(outcome)];
}

TEST(WrittenEnvironment, GivesTheSameStepsAndFrames) {
  int last_successes = 0;
  for (const EnvironmentConfig& config : {OneRigidBodyStep(), OtherSettings()}) {
    const Tally tally = Drive(config, 6);
    if (testing::Test::HasFailure()) return;
    EXPECT_GT(tally.steps, 2000);
    EXPECT_GT(Num(tally, Outcome::kSuccess), 10);
    EXPECT_GT(Num(tally, Outcome::kCollision), 10);
    EXPECT_GE(Num(tally, Outcome::kTimeout), 3);
    EXPECT_LT(tally.unclear, 5);
    last_successes += tally.last_successes;
  }
  EXPECT_GE(last_successes, 2);
}

TEST(WrittenEnvironment, GivesTheSameStepsWhereContactEndsNothing) {
  for (const EnvironmentConfig& config :
       {Scraping(OneRigidBodyStep()), Scraping(OtherSettings())}) {
    const Tally tally = Drive(config, 3);
    if (testing::Test::HasFailure()) return;
    EXPECT_GT(tally.steps, 1500);
    EXPECT_GT(tally.contacts, 100);
    EXPECT_GT(Num(tally, Outcome::kSuccess), 5);
    EXPECT_EQ(Num(tally, Outcome::kCollision), 0);
    EXPECT_LT(tally.unclear, 20);
  }
}

/// What is drawn at random in many episodes, as columns with a row for each.
using Columns = std::map<std::string, std::vector<double>>;

constexpr int kEpisodes = 40000;
constexpr int kBatch = 8;
constexpr int kBeams = 15;  // Words of the noise's stream serve five beams each.

/// A square room that nothing in it comes near to, and something that moves far outside.
std::shared_ptr<const Scene> Room() {
  Course course;
  course.name = "room";
  course.start = {{0.3, -0.2}, 0.4};
  course.goal_W = {9.0, 0.0};
  for (const double side : {-2.5, 2.5}) {
    course.boxes.push_back({{{side, 0.0}, 0.0}, {0.1, 2.6}});
    course.boxes.push_back({{{0.0, side}, 0.0}, {2.6, 0.1}});
  }
  MovingObstacle far;
  far.radius = 0.1;
  far.key_frames = {{0.0, {{50.0, 0.0}, 0.0}}, {7.0, {{51.0, 0.0}, 0.0}}};
  course.moving = {far};
  return MakeScene(std::make_shared<const Course>(course));
}

/// All that is random at work, with a drive that lets each be told from what is seen.
EnvironmentConfig AllRandom() {
  EnvironmentConfig config;
  config.robot.drive = DriveKind::kIdeal;
  config.robot.linear_acceleration = config.robot.angular_acceleration = 1000.0;
  config.robot.command_jitter = 0.1;
  config.lidar.num_beams = kBeams;
  config.lidar.noise_std = 0.05;
  config.localisation = {.position_drift = 0.05, .heading_drift = 0.02};
  config.episode.start_position_jitter = 0.2;
  config.episode.start_yaw_jitter = 0.5;
  return config;
}

std::string NoiseName(int frame, int beam) { return fmt::format("noise {} {}", frame, beam); }

/// Adds the difference between what beams report and what they measure.
void AddNoise(const WrittenEpisode& written, std::span<const std::uint16_t> ranges_cm, int frame,
              Columns& columns) {
  const std::vector<Bracket> ranges = written.Ranges();
  for (int beam = 0; beam < kBeams; ++beam) {
    const auto [low, high] = ranges[static_cast<std::size_t>(beam)];
    columns[NoiseName(frame, beam)].push_back(0.01 * ranges_cm[static_cast<std::size_t>(beam)] -
                                              0.5 * (low + high));
  }
}

/// Of `kEpisodes` episodes, whose seeds follow one another, each driven one step ahead.
Columns Draw() {
  const EnvironmentConfig config = AllRandom();
  const auto scene = Room();
  const Course& course = scene->course();
  CourseEnvironments environments(config, {scene}, kBatch, nullptr);
  const std::vector<env::Action> actions(kBatch, config.action.Normalise(1.0, 0.0));
  std::vector<env::StepResult> results(kBatch);
  Columns columns;
  for (int begin = 0; begin < kEpisodes; begin += kBatch) {
    std::vector<WrittenEpisode> written;
    for (int i = 0; i < kBatch; ++i) {
      const auto seed = static_cast<std::uint64_t>(begin + i);
      environments.Reset(i, {0, seed});
      const base::Pose2 start = environments.robot_pose(i);
      const double time = environments.motion_time(i);
      columns["start x"].push_back(start.p.x - course.start.p.x);
      columns["start y"].push_back(start.p.y - course.start.p.y);
      columns["start yaw"].push_back(start.yaw - course.start.yaw);
      columns["motion time"].push_back(time);
      const auto& episode = written.emplace_back(config, course, start, time);
      AddNoise(episode, environments.observations().frame(i).ranges_cm, 0, columns);
    }
    environments.Step(env::NumbersOf(actions), results);
    for (int i = 0; i < kBatch; ++i) {
      written[i].Step(actions[i], environments.robot_pose(i), false);
      AddNoise(written[i], environments.observations().frame(i).ranges_cm, 1, columns);
      const base::Pose2 believed = environments.observations().odometry[i].X_OR;
      const base::Pose2 truth = written[i].X_OR();
      const double way = base::Norm(truth.p);
      columns["way"].push_back(way);  // By the command's jitter.
      columns["drift ahead"].push_back((believed.p.x - truth.p.x) / std::sqrt(way));
      columns["drift left"].push_back((believed.p.y - truth.p.y) / std::sqrt(way));
      columns["drift yaw"].push_back((believed.yaw - truth.yaw) / std::sqrt(way));
    }
  }
  return columns;
}

const Columns& Drawn() {
  static const Columns columns = Draw();
  return columns;
}

/// What a column should be drawn from.
struct Law {
  double mean, variance, kurtosis;
};

Law Uniform(double low, double high) {
  return {0.5 * (low + high), (high - low) * (high - low) / 12.0, 1.8};
}

Law Normal(double deviation) { return {0.0, deviation * deviation, 3.0}; }

double MeanOf(const std::vector<double>& column) {
  return std::accumulate(column.begin(), column.end(), 0.0) / static_cast<double>(column.size());
}

// Mean and variance within 5 standard errors: a right sampler fails for one seed in a million.
bool Fits(const std::vector<double>& column, const Law& law) {
  const auto n = static_cast<double>(column.size());
  double squares = 0.0;
  for (const double value : column) squares += (value - law.mean) * (value - law.mean) / n;
  return std::abs(MeanOf(column) - law.mean) < 5.0 * std::sqrt(law.variance / n) &&
         std::abs(squares / law.variance - 1.0) < 5.0 * std::sqrt((law.kurtosis - 1.0) / n);
}

/// The pairs of columns that are correlated in an episode, or in two that follow one another. The
/// correlation of independent columns has a standard error of 1 / sqrt(n). 38 columns make 703
/// pairs in an episode and 1444 in two, one of which is beyond 5.5 of them for one seed in 12,000.
std::vector<std::string> Dependences(Columns columns) {
  for (auto& [name, column] : columns) {
    const double mean = MeanOf(column);
    double squares = 0.0;
    for (double& value : column) {
      value -= mean;
      squares += value * value;
    }
    for (double& value : column) value /= std::sqrt(squares);
  }
  std::vector<std::string> found;
  for (const auto& [name, column] : columns) {
    for (const auto& [other_name, other] : columns) {
      for (const int lag : {0, 1}) {
        if (lag == 0 && name >= other_name) continue;
        const double correlation =
            std::inner_product(column.begin() + lag, column.end(), other.begin(), 0.0);
        if (std::abs(correlation) < 5.5 / std::sqrt(static_cast<double>(column.size()))) continue;
        found.push_back(
            fmt::format("{}, {} of {} before: {:.3f}", name, other_name, lag, correlation));
      }
    }
  }
  return found;
}

TEST(WrittenStreams, SpreadAsTheSettingsSay) {
  const EnvironmentConfig config = AllRandom();
  const Columns& columns = Drawn();
  const double jitter = config.episode.start_position_jitter;
  const double turn = config.episode.start_yaw_jitter;
  EXPECT_TRUE(Fits(columns.at("start x"), Uniform(-jitter, jitter)));
  EXPECT_TRUE(Fits(columns.at("start y"), Uniform(-jitter, jitter)));
  EXPECT_TRUE(Fits(columns.at("start yaw"), Uniform(-turn, turn)));
  EXPECT_TRUE(Fits(columns.at("motion time"), Uniform(0.0, 1000.0)));
  EXPECT_TRUE(Fits(columns.at("drift ahead"), Normal(config.localisation.position_drift)));
  EXPECT_TRUE(Fits(columns.at("drift left"), Normal(config.localisation.position_drift)));
  EXPECT_TRUE(Fits(columns.at("drift yaw"), Normal(config.localisation.heading_drift)));
  // Rounding adds an error that is uniform over the resolution.
  const double rounding = config.lidar.resolution * config.lidar.resolution / 12.0;
  const double noise = std::sqrt(config.lidar.noise_std * config.lidar.noise_std + rounding);
  for (const int frame : {0, 1}) {
    for (int beam = 0; beam < kBeams; ++beam) {
      EXPECT_TRUE(Fits(columns.at(NoiseName(frame, beam)), Normal(noise))) << frame << " " << beam;
    }
  }
  EXPECT_FALSE(Fits(columns.at("start x"), Uniform(-0.95 * jitter, 0.95 * jitter)));
  EXPECT_FALSE(Fits(columns.at("start x"), Uniform(-jitter, 1.1 * jitter)));
  EXPECT_FALSE(Fits(columns.at("drift yaw"), Normal(0.95 * config.localisation.heading_drift)));
}

TEST(WrittenStreams, AreIndependent) {
  const Columns& columns = Drawn();
  EXPECT_THAT(Dependences(columns), testing::IsEmpty());

  // The same check refuses noise that is drawn from the stream of the start pose,
  const EnvironmentConfig config = AllRandom();
  const Lidar lidar(config.lidar, config.observation.range_clip);
  const auto scene = Room();
  std::vector<float> exact(kBeams);
  lidar.Cast(scene->collision_map(), {}, exact);
  std::vector<std::uint16_t> ranges(kBeams);
  Columns shared;
  for (const std::string name : {"start x", "start y", "start yaw"})
    shared[name] = columns.at(name);
  for (int episode = 0; episode < kEpisodes; ++episode) {
    base::Random stream(base::DeriveSeed(static_cast<std::uint64_t>(episode), "start pose"));
    lidar.Scan(scene->collision_map(), {}, stream, ranges);
    for (std::size_t beam = 0; beam < kBeams; ++beam) {
      shared[NoiseName(0, static_cast<int>(beam))].push_back(0.01 * ranges[beam] -
                                                             static_cast<double>(exact[beam]));
    }
  }
  EXPECT_THAT(Dependences(shared), testing::SizeIs(testing::Ge(3u)));
  // and a batch that shares the start of its first environment.
  Columns first{{"start x", columns.at("start x")}};
  for (std::size_t i = 0; i < kEpisodes; ++i) {
    first["start x"][i] = columns.at("start x")[i - i % kBatch];
  }
  EXPECT_THAT(Dependences(first), testing::SizeIs(1));
}

}  // namespace
}  // namespace slalom::sim
