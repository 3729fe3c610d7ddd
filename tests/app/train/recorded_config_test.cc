#include "app/train/recorded_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <string>

#include "app/train/begin_run.h"
#include "base/config.h"
#include "base/error.h"

namespace slalom::train {
namespace {

/// A config as it was written before there were friction laws.
std::string Before(RunConfig config) {
  std::string text;
  std::istringstream lines(config::ToToml(config));
  for (std::string line; std::getline(lines, line);) {
    const bool is_new = std::ranges::any_of(
        std::array{"friction =", "centre_of_mass_",
                   "sensor_mass =", "sensor_x =", "sensor_z =", "wheel_width =", "wheel_radius ="},
        [&](const char* key) { return line.starts_with(key); });
    if (!is_new) text += line + "\n";
  }
  return text;
}

TEST(RecordedConfigTest, AConfigFromBeforeFrictionLawsMeansTheDriveOfThen) {
  RunConfig config;
  config.environment.robot.wheel_friction = 0.4;
  const RecordedConfig before = ReadRecordedConfig(Before(config), "old policy");
  EXPECT_TRUE(before.before_friction_laws);
  const sim::RobotConfig& robot = before.config.environment.robot;
  EXPECT_EQ(robot.friction, sim::FrictionLaw::kCone);
  EXPECT_EQ(robot.centre_of_mass_x, 0.0);
  EXPECT_EQ(robot.centre_of_mass_y, 0.0);
  EXPECT_EQ(robot.centre_of_mass_z, 0.0);
  EXPECT_EQ(robot.wheel_width, 0.0);
  EXPECT_EQ(robot.wheel_friction, 0.4);
}

TEST(RecordedConfigTest, AConfigOfTodayIsReadAsItIs) {
  for (const auto law :
       {sim::FrictionLaw::kCone, sim::FrictionLaw::kPyramid, sim::FrictionLaw::kGazebo}) {
    RunConfig config;
    config.environment.robot.friction = law;
    const std::string text = config::ToToml(config);
    const RecordedConfig read = ReadRecordedConfig(text, "policy");
    EXPECT_FALSE(read.before_friction_laws);
    EXPECT_EQ(config::ToToml(read.config), text);
  }
}

TEST(RecordedConfigTest, ARunOfBeforeCannotGoOnWithTodaysDrive) {
  try {
    RequireResumable(Before({}), "runs/old/config.toml", RunConfig{});
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("environment.robot.centre_of_mass_x was 0.0"));
  }
}

}  // namespace
}  // namespace slalom::train
