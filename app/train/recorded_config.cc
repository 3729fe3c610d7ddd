#include "app/train/recorded_config.h"

#include "base/config.h"

namespace slalom::train {
namespace {

RunConfig ReadOver(RunConfig defaults, std::string_view text, std::string_view source) {
  config::ReadToml(text, source, config::ListFields(defaults));
  return defaults;
}

}  // namespace

RecordedConfig ReadRecordedConfig(std::string_view text, std::string_view source) {
  RunConfig before;
  sim::RobotConfig& robot = before.environment.robot;
  robot.friction = sim::FrictionLaw::kCone;
  robot.centre_of_mass_x = robot.centre_of_mass_y = robot.centre_of_mass_z = 0.0;
  robot.sensor_mass = 0.0;
  robot.wheel_width = 0.0;
  RunConfig now;
  now.environment.robot.friction = sim::FrictionLaw::kPyramid;
  RunConfig over_before = ReadOver(before, text, source);
  RunConfig over_now = ReadOver(now, text, source);
  // A text that names the law overrides both.
  if (over_before.environment.robot.friction != over_now.environment.robot.friction) {
    return {.config = std::move(over_before), .before_friction_laws = true};
  }
  return {.config = std::move(over_now)};
}

std::string DescribeDriveBeforeFrictionLaws() {
  return "was trained before environment.robot.friction existed, by Coulomb's cone with "
         "centre_of_mass_x, _y, _z and wheel_width = 0, and drives so unless told otherwise "
         "(--profile configs/jackal.toml: the present drive)";
}

}  // namespace slalom::train
