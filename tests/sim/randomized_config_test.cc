#include "sim/randomized_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "base/random.h"

namespace slalom::sim {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

EnvironmentConfig Task(const std::string& entries) {
  return config::FromToml<EnvironmentConfig>("[randomize]\n" + entries, "task.toml");
}

std::string ErrorOf(const EnvironmentConfig& config) {
  try {
    CheckConsistent(config);
    return "";
  } catch (const base::Error& error) {
    return error.what();
  }
}

TEST(RandomizedConfigTest, DrawsEachKindOfField) {
  RandomizedConfig task(
      Task("\"robot.command_delay\" = [0.02, 0.12]\n"
           "robot.friction = [\"gazebo\", \"cone\"]\n"
           "localisation.from_wheels = [true, false]\n"
           "lidar.offset_x = [-0.1, 0]\n"));
  EXPECT_TRUE(task.config().randomize.empty());
  ASSERT_EQ(task.fields().size(), 4u);
  EXPECT_EQ(task.fields()[2].key, "robot.command_delay");
  EXPECT_EQ(task.fields()[2].unit, "s");
  EXPECT_THAT(task.fields()[3].names, ElementsAre("gazebo", "cone"));
  EXPECT_THAT(task.fields()[1].names, ElementsAre("true", "false"));
  EXPECT_TRUE(task.draws("robot"));
  EXPECT_TRUE(task.draws("lidar"));
  EXPECT_FALSE(task.draws("action"));
  int num_gazebo = 0, num_from_wheels = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    task.Draw(seed);
    const EnvironmentConfig& config = task.config();
    EXPECT_EQ(config.robot.command_delay, task.values()[2]);
    EXPECT_GE(config.robot.command_delay, 0.02);
    EXPECT_LE(config.robot.command_delay, 0.12);
    EXPECT_GE(config.lidar.offset_x, -0.1);
    EXPECT_LE(config.lidar.offset_x, 0.0);
    EXPECT_EQ(config.robot.friction,
              task.values()[3] == 0.0 ? FrictionLaw::kGazebo : FrictionLaw::kCone);
    EXPECT_EQ(config.localisation.from_wheels, task.values()[1] == 0.0);
    num_gazebo += config.robot.friction == FrictionLaw::kGazebo;
    num_from_wheels += config.localisation.from_wheels;
  }
  EXPECT_GT(num_gazebo, 20);
  EXPECT_LT(num_gazebo, 80);
  EXPECT_GT(num_from_wheels, 20);
  EXPECT_LT(num_from_wheels, 80);
}

TEST(RandomizedConfigTest, AShareOfTheEpisodesIsDrawnAndTheOthersAreAsConfigured) {
  const EnvironmentConfig all = Task(
      "robot.command_delay = [0.0, 0.12]\nrobot.friction = [\"gazebo\", \"cone\"]\n"
      "localisation.from_wheels = [true, false]\n");
  EnvironmentConfig some = all;
  some.randomize_share = 0.3;
  RandomizedConfig always(all), sometimes(some);
  const std::string configured = config::ToToml(sim::EnvironmentConfig{});
  int num_drawn = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    always.Draw(seed);
    sometimes.Draw(seed);
    const EnvironmentConfig& drawn = sometimes.config();
    if (drawn.robot.command_delay != 0.0) {
      ++num_drawn;
      EXPECT_EQ(config::ToToml(drawn), config::ToToml(always.config())) << seed;
    } else {
      EXPECT_EQ(config::ToToml(drawn), configured) << seed;
      EXPECT_THAT(sometimes.values(), ElementsAre(1.0, 0.0, 1.0)) << "false, no delay, the cone";
    }
  }
  EXPECT_NEAR(num_drawn, 600, 3.3 * std::sqrt(2000 * 0.3 * 0.7));
}

TEST(RandomizedConfigTest, AShareNeedsConfiguredValuesThatMayBeDrawn) {
  const auto expect = [](const std::string& entry, const std::string& message) {
    EnvironmentConfig config = Task(entry);
    EXPECT_EQ(ErrorOf(config), "");
    config.randomize_share = 0.5;
    EXPECT_EQ(ErrorOf(config), "task.toml:2: environment.randomize." + message +
                                   " among its values, which the field has where it is not drawn, "
                                   "as environment.randomize_share is 0.5");
  };
  expect("robot.command_delay = [0.02, 0.12]",
         "\"robot.command_delay\": found [0.02, 0.12], expected 0.0");
  expect("robot.friction = [\"gazebo\", \"pyramid\"]",
         "\"robot.friction\": found ['gazebo', 'pyramid'], expected \"cone\"");
  expect("localisation.from_wheels = [true]",
         "\"localisation.from_wheels\": found [true], expected false");
}

TEST(RandomizedConfigTest, AValueDependsOnSeedAndKeyAlone) {
  const std::string delay = "robot.command_delay = [0.0, 0.12]\n";
  const std::string others =
      "lidar.offset_x = [0.0, 0.2]\nrobot.friction = [\"cone\", \"pyramid\", \"gazebo\"]\n";
  RandomizedConfig alone(Task(delay)), first(Task(delay + others)), last(Task(others + delay));
  // As a program may have put them together.
  EnvironmentConfig unsorted;
  unsorted.randomize = {{"robot.friction", {"['cone', 'pyramid', 'gazebo']", ""}},
                        {"lidar.offset_x", {"[0.0, 0.2]", ""}},
                        {"robot.command_delay", {"[0.0, 0.12]", ""}}};
  RandomizedConfig backwards(unsorted);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (RandomizedConfig* task : {&alone, &first, &last, &backwards}) task->Draw(seed);
    const std::string drawn = config::ToToml(first.config());
    EXPECT_EQ(config::ToToml(last.config()), drawn);
    EXPECT_EQ(config::ToToml(backwards.config()), drawn);
    EXPECT_EQ(alone.config().robot.command_delay, first.config().robot.command_delay);
    const double before = alone.config().robot.command_delay;
    alone.Draw(seed + 1);
    EXPECT_NE(alone.config().robot.command_delay, before);
    alone.Draw(seed);
    EXPECT_EQ(alone.config().robot.command_delay, before);
  }
}

constexpr int kNumDraws = 20000;

/// Values of the fields over the seeds 0, 1, ...: one list for each field.
std::vector<std::vector<double>> Draws(const EnvironmentConfig& config) {
  RandomizedConfig task(config);
  std::vector<std::vector<double>> draws(task.fields().size());
  for (int seed = 0; seed < kNumDraws; ++seed) {
    task.Draw(static_cast<std::uint64_t>(seed));
    for (std::size_t i = 0; i < draws.size(); ++i) draws[i].push_back(task.values()[i]);
  }
  return draws;
}

/// Kolmogorov and Smirnov's distance of shares in [0, 1] from the uniform distribution, times the
/// root of their number. Uniform ones exceed 1.95 with probability 2 exp(-2 x 1.95^2) = 0.001.
double DistanceFromUniform(std::vector<double> shares) {
  std::ranges::sort(shares);
  const double n = static_cast<double>(shares.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double below = static_cast<double>(i) / n;
    distance = std::max({distance, shares[i] - below, below + 1.0 / n - shares[i]});
  }
  return distance * std::sqrt(n);
}

TEST(RandomizedConfigTest, NumbersAreUniform) {
  auto draws = Draws(Task("robot.wheel_friction = [0.25, 0.75]\nlidar.noise_std = [0, 0.04]\n"));
  for (double& value : draws[0]) value = value / 0.04;
  for (double& value : draws[1]) value = (value - 0.25) / 0.5;
  EXPECT_LT(DistanceFromUniform(draws[0]), 1.95);
  EXPECT_LT(DistanceFromUniform(draws[1]), 1.95);
  // A sampler that is 2 % off must fail.
  for (double& value : draws[1]) value = std::pow(value, 1.05);
  EXPECT_GT(DistanceFromUniform(draws[1]), 1.95);
}

/// Pearson's statistic for counts of equally likely values.
double ChiSquare(const std::vector<double>& counts) {
  double total = 0.0, sum = 0.0;
  for (const double count : counts) total += count;
  const double expected = total / static_cast<double>(counts.size());
  for (const double count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

TEST(RandomizedConfigTest, NamesAreEquallyLikely) {
  const auto draws = Draws(Task("robot.friction = [\"cone\", \"pyramid\", \"gazebo\"]\n"));
  std::vector<double> counts(3);
  for (const double value : draws[0]) ++counts[static_cast<std::size_t>(value)];
  // With 2 degrees of freedom: exp(-13.8 / 2) = 0.001.
  EXPECT_LT(ChiSquare(counts), 13.8);
  counts[0] += 400;  // 2 % of all.
  EXPECT_GT(ChiSquare(counts), 13.8);
}

double Correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const double n = static_cast<double>(a.size());
  double mean_a = 0.0, mean_b = 0.0, ab = 0.0, aa = 0.0, bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i] / n;
    mean_b += b[i] / n;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return ab / std::sqrt(aa * bb);
}

TEST(RandomizedConfigTest, FieldsAndEpisodesAreIndependent) {
  const auto draws =
      Draws(Task("robot.command_delay = [0.0, 0.12]\nrobot.command_jitter = [0.0, 0.12]\n"
                 "robot.friction = [\"cone\", \"gazebo\"]\nlidar.offset_x = [-0.1, 0.1]\n"));
  // The correlation of independent lists has a standard deviation of 1 / sqrt(n).
  const double bound = 4.0 / std::sqrt(static_cast<double>(kNumDraws));
  for (std::size_t i = 0; i < draws.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      EXPECT_LT(std::abs(Correlation(draws[i], draws[k])), bound) << i << " " << k;
    }
    std::vector<double> next = draws[i];
    std::rotate(next.begin(), next.begin() + 1, next.end());
    EXPECT_LT(std::abs(Correlation(draws[i], next)), bound) << i;
  }
  // Fields that share a stream in part must fail.
  std::vector<double> mixed = draws[1];
  for (std::size_t i = 0; i < mixed.size(); ++i) mixed[i] += 0.05 * draws[2][i];
  EXPECT_GT(std::abs(Correlation(mixed, draws[2])), bound);
}

TEST(RandomizedConfigTest, EntriesThatMakeNoSenseAreRefused) {
  const auto expect = [](const std::string& entry, const testing::Matcher<std::string>& message) {
    const std::string error = ErrorOf(Task(entry + "\n"));
    EXPECT_THAT(error, AllOf(HasSubstr("task.toml:2: environment.randomize.\""), message)) << entry;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  };
  expect("robot.comand_delay = [0, 1]",
         HasSubstr("there is no field environment.robot.comand_delay; did you mean "
                   "'robot.command_delay'?"));
  expect("environment.robot.command_delay = [0, 1]", HasSubstr("there is no field"));
  expect("randomize = [0, 1]", HasSubstr("there is no field"));
  expect("robot.command_delay = 0.1",
         AllOf(HasSubstr("robot.command_delay\": found 0.1"),
               HasSubstr("expected [smallest, largest], two numbers in [0, 1] s")));
  expect("robot.command_delay = [0.1]", HasSubstr("expected [smallest, largest]"));
  expect("robot.command_delay = [0.1, 0.2, 0.3]", HasSubstr("expected [smallest, largest]"));
  expect("robot.command_delay = [0.1, 2.0]", HasSubstr("found [0.1, 2.0], expected [smallest"));
  expect("robot.command_delay = [0.2, 0.1]", HasSubstr("expected the smaller number first"));
  expect("robot.command_delay = ['a', 'b']", HasSubstr("expected [smallest, largest]"));
  expect("robot.command_delay = [nan, 0.1]", HasSubstr("expected [smallest, largest]"));
  expect("robot.friction = \"cone\"", HasSubstr("expected a list with any of 'cone', 'pyramid'"));
  expect("robot.friction = []", HasSubstr("expected a list with any of"));
  expect("robot.friction = ['cone', 'ice']", HasSubstr("expected a list with any of"));
  expect("robot.friction = ['cone', 'cone']", HasSubstr("expected each of its values once"));
  expect("robot.friction = [0.0, 1.0]", HasSubstr("expected a list with any of"));
  expect("localisation.from_wheels = [0, 1]", HasSubstr("expected a list of true, false or both"));
  EXPECT_EQ(ErrorOf(Task("robot.command_delay = [0.1, 0.1]\n")), "") << "a range of one number";
}

TEST(RandomizedConfigTest, FieldsThatABatchSharesAreRefusedWithTheReason) {
  // Every field of the task is either drawn or refused with a reason.
  EnvironmentConfig any;
  int num_drawn = 0, num_shared = 0;
  for (const config::Field& field : config::ListFields(any).fields) {
    if (field.key == "randomize") continue;
    EnvironmentConfig config;
    const std::string value = config::PrintValue(field);
    const bool is_name = !field.range && field.choices.empty();
    config.randomize = {{field.key, {"[" + value + (is_name ? "" : ", " + value) + "]", ""}}};
    if (!field.choices.empty()) config.randomize[0].value.text = "[" + value + "]";
    const std::string error = ErrorOf(config);
    const bool is_of_the_world = field.key.starts_with("robot.") ||
                                 field.key.starts_with("lidar.") ||
                                 field.key.starts_with("localisation.");
    (error.empty() ? num_drawn : num_shared) += 1;
    if (error.empty()) {
      EXPECT_TRUE(is_of_the_world) << field.key;
    } else {
      EXPECT_THAT(error, AllOf(HasSubstr("environment.randomize.\"" + field.key + "\""),
                               HasSubstr("is the same in all episodes, because ")));
    }
  }
  EXPECT_EQ(num_drawn, 25 + 9 + 7) << "of robot, lidar and localisation";
  EXPECT_GT(num_shared, 15);
  EXPECT_THAT(ErrorOf(Task("lidar.num_beams = [360, 720]\n")),
              HasSubstr("it is the shape of an observation"));
}

TEST(RandomizedConfigTest, ValuesThatContradictEachOtherAreRefused) {
  const std::string slippery = "robot.wheel_friction = [0.3, 1.2]\n";
  EXPECT_EQ(ErrorOf(Task(slippery)), "");
  EXPECT_THAT(ErrorOf(Task(slippery + "robot.friction = [\"cone\", \"gazebo\"]\n")),
              AllOf(HasSubstr("environment.randomize: values that contradict"),
                    HasSubstr("environment.robot.wheel_friction is 1.2")));
  EXPECT_EQ(ErrorOf(Task(slippery + "robot.friction = [\"cone\", \"pyramid\"]\n")), "");
  EXPECT_THAT(ErrorOf(Task("lidar.min_range = [0.1, 3]\nlidar.max_range = [2, 30]\n")),
              HasSubstr("environment.lidar.min_range (3 m) must be below"));
  EXPECT_THAT(ErrorOf(Task("lidar.min_range = [0.1, 6]\n")),
              HasSubstr("environment.observation.range_clip"));
  EXPECT_THAT(ErrorOf(Task("robot.wheel_width = [0.0, 0.5]\n")),
              HasSubstr("environment.robot.track"));
  EXPECT_THAT(ErrorOf(Task("robot.sensor_mass = [0.0, 20.0]\nrobot.sensor_x = [0.1, 0.5]\n")),
              HasSubstr("the centre of mass is at"));
  EXPECT_EQ(ErrorOf(Task("robot.sensor_mass = [0.0, 1.0]\nrobot.sensor_x = [0.1, 0.2]\n")), "");
}

/// Random tasks: whatever passes the check is drawn without contradiction.
TEST(RandomizedConfigTest, NoDrawContradictsItselfAfterTheCheck) {
  base::Random random(3);
  constexpr std::array<const char*, 9> kKeys = {
      "robot.wheel_friction", "robot.track",    "robot.wheel_width",
      "robot.sensor_mass",    "robot.sensor_x", "robot.centre_of_mass_x",
      "robot.wheel_base",     "robot.mass",     "lidar.min_range"};
  constexpr std::array<std::array<double, 2>, 9> kSpans = {{{0.1, 1.5},
                                                            {0.1, 0.5},
                                                            {0.0, 0.2},
                                                            {0.0, 15.0},
                                                            {-0.3, 0.3},
                                                            {-0.1, 0.1},
                                                            {0.1, 0.5},
                                                            {5.0, 20.0},
                                                            {0.0, 8.0}}};
  int num_taken = 0, num_refused = 0;
  for (int round = 0; round < 300; ++round) {
    EnvironmentConfig config;
    config.randomize = {{"robot.friction", {"['cone', 'gazebo']", ""}}};
    for (std::size_t i = 0; i < kKeys.size(); ++i) {
      if (random.UniformInt(3) == 0) continue;
      double low = random.Uniform(kSpans[i][0], kSpans[i][1]);
      double high = low + (kSpans[i][1] - low) * random.Uniform(0.0, 0.7);
      config.randomize.push_back(
          {kKeys[i], {std::to_string(low) + ", " + std::to_string(high), ""}});
      config.randomize.back().value.text = "[" + config.randomize.back().value.text + "]";
    }
    if (!ErrorOf(config).empty()) {
      ++num_refused;
      continue;
    }
    ++num_taken;
    RandomizedConfig task(config);
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      task.Draw(seed);
      ASSERT_EQ(ErrorOf(task.config()), "");
    }
  }
  EXPECT_GT(num_taken, 30);
  EXPECT_GT(num_refused, 30);
}

}  // namespace
}  // namespace slalom::sim
