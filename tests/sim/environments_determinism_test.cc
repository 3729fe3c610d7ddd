#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "sim/environments.h"
#include "sim/randomized_config.h"
#include "tests/support/allocation_count.h"
#include "tests/support/moving_courses.h"
#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

constexpr int kNumEpisodes = 36;
constexpr int kNumCourses = 12;

std::vector<std::shared_ptr<const Scene>> Scenes() {
  base::Random random(11);
  CourseSet set;
  for (int i = 0; i < kNumCourses; ++i) {
    const bool dynamic = i % 3 == 2;
    const auto fixed =
        test::RandomCourse(random, {.num_circles = dynamic ? 8 : 50, .num_boxes = i / 2});
    set.courses.push_back(dynamic ? test::WithMoving(*fixed, i, random) : fixed);
  }
  return MakeScenes(set);
}

/// Every element of the simulation at work.
EnvironmentConfig TestConfig() {
  EnvironmentConfig config;
  config.robot.linear_acceleration = 4.0;
  config.robot.angular_acceleration = 10.0;
  config.robot.speed_gain = 0.95;
  config.robot.yaw_gain = 0.8;
  config.robot.wheel_imbalance = 0.02;
  config.robot.command_delay = 0.04;
  config.robot.command_jitter = 0.25;
  config.lidar.offset_y = 0.05;
  config.lidar.noise_std = 0.02;
  config.lidar.noise_per_metre = 0.005;
  config.lidar.dropout_probability = 0.01;
  config.localisation = {.position_drift = 0.05, .heading_drift = 0.02, .turn_drift = 0.03};
  config.episode.start_position_jitter = 0.05;
  config.episode.start_yaw_jitter = 3.0;
  config.episode.max_steps = 60;
  return config;
}

EnvironmentConfig IdealConfig() {
  EnvironmentConfig config = TestConfig();
  config.robot.drive = DriveKind::kIdeal;
  return config;
}

EnvironmentConfig GazeboConfig() {
  EnvironmentConfig config = TestConfig();
  config.robot.friction = FrictionLaw::kGazebo;
  config.robot.sensor_mass = 1.1;
  return config;
}

EnvironmentConfig PyramidConfig() {
  EnvironmentConfig config = TestConfig();
  config.robot.friction = FrictionLaw::kPyramid;
  return config;
}

EnvironmentConfig ScrapingConfig() {
  EnvironmentConfig config = TestConfig();
  config.episode.collision_ends = false;
  return config;
}

/// Everything that may differ from episode to episode does, robots of all kinds side by side.
EnvironmentConfig RandomizedConfigOf(bool robot = true, bool lidar = true) {
  EnvironmentConfig config = TestConfig();
  config.randomize = {{"localisation.from_wheels", {"[false, true]", ""}},
                      {"localisation.position_drift", {"[0.0, 0.1]", ""}}};
  const auto add = [&config](const char* key, const char* value) {
    config.randomize.push_back({key, {value, ""}});
  };
  if (lidar) {
    add("lidar.field_of_view", "[4.0, 6.0]");
    add("lidar.offset_x", "[-0.1, 0.15]");
    add("lidar.max_range", "[4.0, 10.0]");
    add("lidar.noise_std", "[0.0, 0.05]");
    add("lidar.noise_per_metre", "[0.0, 0.01]");
    add("lidar.dropout_probability", "[0.0, 0.1]");
  }
  if (robot) {
    add("robot.drive", "['skid-steer', 'ideal']");
    add("robot.friction", "['cone', 'pyramid', 'gazebo']");
    add("robot.wheel_friction", "[0.2, 0.9]");
    add("robot.mass", "[12.0, 25.0]");
    add("robot.yaw_inertia", "[0.3, 0.8]");
    add("robot.sensor_mass", "[0.0, 2.0]");
    add("robot.track", "[0.3, 0.4]");
    add("robot.command_delay", "[0.0, 0.3]");
    add("robot.command_jitter", "[0.0, 0.3]");
    add("robot.yaw_gain", "[0.7, 1.1]");
    add("robot.linear_acceleration", "[1.0, 20.0]");
  }
  return config;
}

/// Drives where the wider half of the scan is: actions depend on every number observed so far.
env::Action Steer(const env::FrameView& frame) {
  const std::size_t half = frame.ranges_cm.size() / 2;
  const auto begin = frame.ranges_cm.begin();
  const int right = std::accumulate(begin, begin + half, 0);
  const int left = std::accumulate(begin + half, frame.ranges_cm.end(), 0);
  return {0.3f, static_cast<float>(left - right) / static_cast<float>(std::max(left + right, 1)) +
                    0.05f * frame.state[1]};
}

constexpr int kNumbers = 14;  // Per step: reward, cost, outcome, state, pose, time, odometry.

/// All that an episode gives.
struct Record {
  std::vector<env::Action> actions;
  std::vector<float> numbers;  // [kNumbers] per step.
  std::vector<std::uint16_t> ranges;

  friend bool operator==(const Record&, const Record&) = default;

  void Add(const CourseEnvironments& environments, int i, const env::StepResult& result) {
    const env::FrameView frame = environments.observations().frame(i);
    ranges.insert(ranges.end(), frame.ranges_cm.begin(), frame.ranges_cm.end());
    numbers.insert(numbers.end(), {result.reward, result.cost, static_cast<float>(result.outcome)});
    numbers.insert(numbers.end(), frame.state.begin(), frame.state.end());
    const base::Pose2 X_WR = environments.robot_pose(i);
    numbers.insert(numbers.end(),
                   {static_cast<float>(X_WR.p.x), static_cast<float>(X_WR.p.y),
                    static_cast<float>(X_WR.yaw), static_cast<float>(environments.motion_time(i))});
    const env::Odometry& odometry = environments.observations().odometry[i];
    numbers.insert(numbers.end(),
                   {static_cast<float>(odometry.X_OR.p.x), static_cast<float>(odometry.X_OR.p.y),
                    static_cast<float>(odometry.X_OR.yaw)});
  }
};

env::EpisodeSpec SpecOf(int episode) {
  return {episode % kNumCourses, 1000u + static_cast<std::uint64_t>(episode)};
}

/// Plays all episodes in the given order, `batch_size` at a time, refilling places as they fall
/// free.
std::vector<Record> Play(int batch_size, int num_threads, bool backwards,
                         Robot::Stepping stepping = Robot::Stepping::kBox2dInContact,
                         const EnvironmentConfig& config = TestConfig()) {
  base::ParallelFor parallel(num_threads);
  CourseEnvironments environments(config, Scenes(), batch_size, &parallel, MakeRobots(stepping));
  std::vector<Record> records(kNumEpisodes);
  std::vector<int> episode_of(batch_size, -1);
  int num_started = 0;
  const auto start = [&](int i) {
    episode_of[i] = -1;
    if (num_started == kNumEpisodes) return;
    episode_of[i] = backwards ? kNumEpisodes - 1 - num_started : num_started;
    ++num_started;
    environments.Reset(i, SpecOf(episode_of[i]));
    records[episode_of[i]].Add(environments, i, {});
  };
  for (int i = 0; i < batch_size; ++i) start(i);
  std::vector<env::Action> actions(batch_size);
  std::vector<env::StepResult> results(batch_size);
  while (std::any_of(episode_of.begin(), episode_of.end(), [](int e) { return e >= 0; })) {
    for (int i = 0; i < batch_size; ++i) actions[i] = Steer(environments.observations().frame(i));
    environments.Step(env::NumbersOf(actions), results);
    for (int i = 0; i < batch_size; ++i) {
      if (episode_of[i] < 0) continue;
      records[episode_of[i]].actions.push_back(actions[i]);
      records[episode_of[i]].Add(environments, i, results[i]);
      if (results[i].ended()) start(i);
    }
  }
  return records;
}

template <class T>
std::uint64_t HashOf(const std::vector<T>& values, std::uint64_t seed) {
  return base::Checksum(std::as_bytes(std::span(values)), seed);
}

std::uint64_t HashOf(const std::vector<Record>& records) {
  std::uint64_t hash = 0;
  for (const Record& record : records) {
    hash = HashOf(record.ranges, HashOf(record.numbers, HashOf(record.actions, hash)));
  }
  return hash;
}

// Debug, release and sanitizer builds must all give this. It changes only with a change of the
// simulation, which CHANGELOG.md then names. written_environment_test.cc tells whether a new one
// stands for the right thing.
constexpr std::uint64_t kGoldenHash = 10309596538404691480u;
constexpr std::uint64_t kGazeboHash = 15556016397180356100u;
constexpr std::uint64_t kPyramidHash = 1000322604016261304u;
constexpr std::uint64_t kRandomizedHash = 9705012514232965408u;

TEST(EnvironmentsDeterminismTest, GoldenHash) {
  const std::vector<Record> records = Play(kNumEpisodes, 1, false);
  EXPECT_EQ(HashOf(records), kGoldenHash);
  int collisions = 0, longest = 0;
  for (const Record& record : records) {
    const auto outcome =
        static_cast<env::Outcome>(record.numbers[record.numbers.size() - kNumbers + 2]);
    collisions += outcome == env::Outcome::kCollision;
    longest = std::max(longest, static_cast<int>(record.actions.size()));
  }
  EXPECT_GE(collisions, 6) << "contacts are part of it";
  EXPECT_EQ(longest, 60) << "and long drives";
  constexpr auto kStepping = Robot::Stepping::kBox2dInContact;
  EXPECT_EQ(HashOf(Play(kNumEpisodes, 1, false, kStepping, GazeboConfig())), kGazeboHash);
  EXPECT_EQ(HashOf(Play(kNumEpisodes, 1, false, kStepping, PyramidConfig())), kPyramidHash);
  EXPECT_EQ(HashOf(Play(kNumEpisodes, 1, false, kStepping, RandomizedConfigOf())), kRandomizedHash);
}

TEST(EnvironmentsDeterminismTest, ARandomisedEpisodeIsThatOfAConfigWithTheDrawnValues) {
  for (const EnvironmentConfig& config :
       {RandomizedConfigOf(), RandomizedConfigOf(true, false), RandomizedConfigOf(false, true),
        RandomizedConfigOf(false, false)}) {
    constexpr auto kStepping = Robot::Stepping::kBox2dInContact;
    const std::vector<Record> records = Play(kNumEpisodes, 1, false, kStepping, config);
    EXPECT_EQ(Play(7, 3, true, kStepping, config), records);
    RandomizedConfig task(config);
    for (int episode = 0; episode < kNumEpisodes; ++episode) {
      task.Draw(SpecOf(episode).seed);
      CourseEnvironments environments(task.config(), Scenes(), 1, nullptr);
      ASSERT_TRUE(environments.config().randomize.empty());
      Record plain;
      environments.Reset(0, SpecOf(episode));
      plain.Add(environments, 0, {});
      std::vector<env::StepResult> results(1);
      while (!results[0].ended()) {
        const env::Action action = Steer(environments.observations().frame(0));
        environments.Step(env::NumbersOf(std::vector{action}), results);
        plain.actions.push_back(action);
        plain.Add(environments, 0, results[0]);
      }
      ASSERT_EQ(plain, records[episode]) << episode;
    }
  }
}

/// An entry of [environment.randomize] for each field that may be drawn, by the code's own list:
/// any name or boolean, or a number near the field's own.
base::TomlAssignments DrawableEntries(EnvironmentConfig config) {
  base::TomlAssignments entries;
  for (const config::Field& field : config::ListFields(config).fields) {
    std::string values;
    if (const double* const* number = std::get_if<double*>(&field.value)) {
      const auto within = [&](double value) {
        return std::clamp(value, field.range->min, field.range->max);
      };
      values =
          fmt::format("[{}, {}]", within(0.8 * **number - 0.02), within(1.2 * **number + 0.02));
    } else if (std::holds_alternative<bool*>(field.value)) {
      values = "[false, true]";
    } else if (!field.choices.empty()) {
      values = fmt::format("['{}']", fmt::join(field.choices, "', '"));
    } else {
      continue;
    }
    config.randomize = {{field.key, {values, ""}}};
    try {
      const RandomizedConfig task(config);
      entries.push_back(config.randomize.front());
    } catch (const base::Error&) {  // All episodes share this field.
    }
  }
  return entries;
}

TEST(EnvironmentsDeterminismTest, EachFieldThatMayBeDrawnIsTheDrawnOneInItsEpisode) {
  const auto play = [](CourseEnvironments& environments, int episode) {
    Record record;
    environments.Reset(0, SpecOf(episode));
    record.Add(environments, 0, {});
    std::vector<env::StepResult> results(1);
    for (int step = 0; step < 5 && !results[0].ended(); ++step) {
      environments.Step(env::NumbersOf(std::vector{env::Action{0.9f, 0.5f}}), results);
      record.Add(environments, 0, results[0]);
    }
    return record;
  };
  const auto scenes = Scenes();
  // Friction by the law that knows all fields, and a LiDAR that meets its ranges.
  EnvironmentConfig config = GazeboConfig();
  config.observation.speeds = true;
  config.lidar.max_range = 2.0;
  config.lidar.min_range = 0.8;
  config.lidar.resolution = 0.05;
  config.robot.angular_speed_limit = 0.5;
  config.robot.linear_speed_limit = 1.0;
  config.localisation.speed_noise = 0.1;
  config.localisation.turn_rate_noise = 0.1;
  config.localisation.speed_delay = 0.2;
  const base::TomlAssignments entries = DrawableEntries(config);
  EXPECT_GT(entries.size(), 40u);
  CourseEnvironments own(config, scenes, 1, nullptr);
  std::vector<Record> undrawn;
  for (int episode = 0; episode < 4; ++episode) undrawn.push_back(play(own, episode));
  for (const base::TomlAssignment& entry : entries) {
    EnvironmentConfig random = config;
    random.randomize = {entry};
    CourseEnvironments drawn(random, scenes, 1, nullptr);
    RandomizedConfig task(random);
    bool has_effect = false;
    for (int episode = 0; episode < 4; ++episode) {
      task.Draw(SpecOf(episode).seed);
      CourseEnvironments plain(task.config(), scenes, 1, nullptr);
      const Record expected = play(plain, episode);
      EXPECT_EQ(play(drawn, episode), expected) << entry.key << ", episode " << episode;
      has_effect = has_effect || expected != undrawn[static_cast<std::size_t>(episode)];
    }
    EXPECT_TRUE(has_effect) << entry.key << ": the test does not see this field";
  }
}

TEST(EnvironmentsDeterminismTest, DoesNotDependOnBatchOrderOrThreads) {
  const std::vector<Record> records = Play(kNumEpisodes, 1, false);
  EXPECT_EQ(Play(1, 1, false), records);
  EXPECT_EQ(Play(1, 1, true), records);
  EXPECT_EQ(Play(7, 2, true), records);
  EXPECT_EQ(Play(10, 3, false), records);
  EXPECT_EQ(Play(kNumEpisodes, 4, true), records);

  constexpr auto kStepping = Robot::Stepping::kBox2dInContact;
  const std::vector<Record> scraping = Play(kNumEpisodes, 1, false, kStepping, ScrapingConfig());
  EXPECT_NE(scraping, records);
  EXPECT_EQ(Play(7, 3, true, kStepping, ScrapingConfig()), scraping) << "contacts that last";
  EXPECT_EQ(Play(7, 3, true, kStepping, GazeboConfig()),
            Play(kNumEpisodes, 1, false, kStepping, GazeboConfig()));
}

TEST(EnvironmentsDeterminismTest, Box2dAlwaysGivesTheSameBits) {
  for (const EnvironmentConfig& config :
       {TestConfig(), GazeboConfig(), IdealConfig(), ScrapingConfig(), RandomizedConfigOf()}) {
    EXPECT_EQ(Play(8, 1, false, Robot::Stepping::kBox2dAlways, config),
              Play(8, 1, false, Robot::Stepping::kBox2dInContact, config));
  }
}

TEST(EnvironmentsDeterminismTest, RecordedActionsReplayTheEpisode) {
  const std::vector<Record> records = Play(5, 1, false);
  CourseEnvironments environments(TestConfig(), Scenes(), 1, nullptr);
  for (int episode = 0; episode < kNumEpisodes; ++episode) {
    Record again;
    environments.Reset(0, SpecOf(episode));
    again.Add(environments, 0, {});
    for (const env::Action& action : records[episode].actions) {
      std::vector<env::StepResult> results(1);
      environments.Step(env::NumbersOf(std::vector{action}), results);
      again.actions.push_back(action);
      again.Add(environments, 0, results[0]);
    }
    ASSERT_EQ(again, records[episode]);
  }
}

TEST(EnvironmentsDeterminismTest, SeedsDiffer) {
  CourseEnvironments environments(TestConfig(), Scenes(), 3, nullptr);
  environments.Reset(0, {2, 1});
  environments.Reset(1, {2, 2});
  environments.Reset(2, {2, 1});
  const auto scan = [&](int i) {
    const auto ranges = environments.observations().frame(i).ranges_cm;
    return std::vector<std::uint16_t>(ranges.begin(), ranges.end());
  };
  EXPECT_NE(scan(0), scan(1));
  EXPECT_EQ(scan(0), scan(2));
  EXPECT_FALSE(environments.robot_pose(0) == environments.robot_pose(1));
}

/// With fields of the robot left alone, as another robot has memory of its own. On one thread, as a
/// second one makes a Box2D world when robots of both first touch something at the same time.
TEST(EnvironmentsDeterminismTest, StepsAllocateNothing) {
  for (const EnvironmentConfig& config : {TestConfig(), RandomizedConfigOf(/*robot=*/false)}) {
    base::ParallelFor parallel(1);
    CourseEnvironments environments(config, Scenes(), 16, &parallel);
    std::vector<env::Action> actions(16);
    std::vector<env::StepResult> results(16);
    for (int i = 0; i < 16; ++i) environments.Reset(i, SpecOf(i));
    int num_ended = 0;
    const auto step = [&] {
      for (int i = 0; i < 16; ++i) actions[i] = Steer(environments.observations().frame(i));
      environments.Step(env::NumbersOf(actions), results);
      for (int i = 0; i < 16; ++i) {
        if (!results[i].ended()) continue;
        ++num_ended;
        environments.Reset(i, SpecOf(i + num_ended));
      }
    };
    for (int k = 0; k < 1000; ++k) step();
    num_ended = 0;
    const long before = test::NumAllocations();
    for (int k = 0; k < 200; ++k) step();
    EXPECT_EQ(test::NumAllocations() - before, 0);
    EXPECT_GT(num_ended, 50);
  }
}

}  // namespace
}  // namespace slalom::sim
