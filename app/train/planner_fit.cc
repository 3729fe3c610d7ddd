#include "app/train/planner_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>
#include <string_view>
#include <variant>

#include "base/config.h"
#include "base/log.h"
#include "planners/navigation/footprint.h"

namespace slalom::train {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

class Fit {
 public:
  explicit Fit(planners::PlannersConfig& planners)
      : fields_(config::ListFields(planners)), defaults_(config::ListFields(default_)) {}

  void AtMost(double limit, std::string_view of, std::initializer_list<const char*> keys) const {
    for (const char* key : keys) Within(key, -kNone, limit, of);
  }
  void AtLeast(double limit, std::string_view of, std::initializer_list<const char*> keys) const {
    for (const char* key : keys) Within(key, limit, kNone, of);
  }
  /// `of`: what the bounds follow from.
  void Within(std::string_view key, double low, double high, std::string_view of) const {
    const auto index = std::ranges::find(fields_.fields, key, &config::Field::key);
    const config::Field& field = *index;
    const config::Field& usual = defaults_.fields[index - fields_.fields.begin()];
    double& value = *std::get<double*>(field.value);
    if (low <= value && value <= high) return;
    if (value == *std::get<double*>(usual.value)) {
      value = std::clamp(std::clamp(value, low, high), field.range->min, field.range->max);
      return;
    }
    const std::string expected = low == high     ? fmt::format("{:.6g}", low)
                                 : high == kNone ? fmt::format("at least {:.6g}", low)
                                 : low == -kNone ? fmt::format("at most {:.6g}", high)
                                                 : fmt::format("{:.6g} to {:.6g}", low, high);
    spdlog::warn("{} = {} {} contradicts the robot: expected {} {} by {}", key, value, field.unit,
                 expected, field.unit, of);
  }

 private:
  planners::PlannersConfig default_;
  config::FieldList fields_, defaults_;
};

}  // namespace

void FitToRobot(const sim::EnvironmentConfig& environment, planners::PlannersConfig& planners) {
  const Fit fit(planners);
  const sim::RobotConfig& robot = environment.robot;
  const env::ActionBounds& action = environment.action;

  // ROS's outline of the Jackal is its chassis, which is that much smaller than with its wheels.
  const sim::RobotConfig jackal;
  const planners::FootprintConfig chassis;
  planners::FootprintConfig& footprint = planners.navigation.footprint;
  fit.Within("navigation.footprint.length", chassis.length + (robot.length - jackal.length),
             robot.length, "environment.robot.length");
  fit.Within("navigation.footprint.width", chassis.width + (robot.width - jackal.width),
             robot.width, "environment.robot.width");
  for (const char* key : {"teb.robot.outline_length", "mppi.outline_length"}) {
    fit.Within(key, robot.length, robot.length, "environment.robot.length");
  }
  for (const char* key : {"teb.robot.outline_width", "mppi.outline_width"}) {
    fit.Within(key, robot.width, robot.width, "environment.robot.width");
  }
  fit.AtLeast(planners::PaddedFootprint(footprint).inscribed_radius(), "navigation.footprint",
              {"dwa.navigation.inflation_radius", "eband.navigation.inflation_radius",
               "teb.navigation.inflation_radius", "mppi.navigation.inflation_radius"});
  fit.AtLeast(0.5 * std::min(robot.length, robot.width), "environment.robot",
              {"teb.obstacle.min_distance", "teb.obstacle.inflation_distance"});

  const double delay = robot.command_delay + 0.5 * robot.command_jitter;
  fit.Within("navigation.command_delay", delay, delay,
             "environment.robot.command_delay and half of .command_jitter");

  const std::string speeds = "environment.action and environment.robot.linear_speed_limit";
  const double ahead = std::min(action.linear_max, robot.linear_speed_limit);
  fit.AtMost(ahead, speeds,
             {"dwa.max_speed", "dwa.min_speed", "eband.max_speed", "eband.min_speed",
              "teb.robot.max_linear", "mppi.max_linear"});
  const double back = std::min(-action.linear_min, robot.linear_speed_limit);
  fit.AtMost(back, speeds, {"teb.robot.max_backward"});
  fit.AtLeast(-back, speeds, {"dwa.escape_speed", "mppi.min_linear"});
  fit.AtMost(std::min(action.angular_max, robot.angular_speed_limit),
             "environment.action.angular_max and environment.robot.angular_speed_limit",
             {"dwa.max_turn_rate", "dwa.min_turn_rate_in_place", "eband.max_turn_rate",
              "eband.min_turn_rate", "eband.min_turn_rate_in_place", "teb.robot.max_angular",
              "mppi.max_angular", "navigation.recovery_max_turn_rate",
              "navigation.recovery_min_turn_rate"});
  fit.AtMost(robot.linear_acceleration, "environment.robot.linear_acceleration",
             {"dwa.acceleration", "teb.robot.max_acceleration", "mppi.max_acceleration"});
  fit.AtMost(robot.angular_acceleration, "environment.robot.angular_acceleration",
             {"dwa.turn_acceleration", "teb.robot.max_angular_acceleration",
              "mppi.max_angular_acceleration", "navigation.recovery_turn_acceleration"});
}

}  // namespace slalom::train
