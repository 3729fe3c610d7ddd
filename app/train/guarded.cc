#include "app/train/guarded.h"

#include <memory>
#include <numbers>
#include <utility>

#include "app/train/planner_fit.h"
#include "base/config.h"
#include "planners/localisation/scan_matching_agent.h"
#include "planners/planner_registry.h"
#include "sim/lidar.h"
#include "sim/mass_distribution.h"

namespace slalom::train {
namespace {

struct GuardSection {
  planners::GuardConfig guard;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("guard", guard, "");
  }
};

void RequireRead(planners::GuardConfig guard) {
  if (guard.enabled()) return;
  GuardSection found{guard}, defaults;
  config::RequireRead(config::ListFields(found), config::ListFields(defaults));
}

/// MPPI as it drives on the task, with maps that reach farther, and that never gives up.
planners::GuidePlanner GuidePlannerOf(const sim::EnvironmentConfig& environment,
                                      const planners::GuardConfig& guard) {
  planners::PlannersConfig config;
  FitToRobot(environment, config);
  planners::NavigationConfig& navigation = config.navigation;
  navigation.obstacle_range = guard.obstacle_range;
  navigation.raytrace_range = guard.raytrace_range;
  navigation.marks_stay = true;  // Or a path leads through the wall at the robot's nose.
  navigation.planner_patience = navigation.controller_patience = 1e6;
  return {navigation, planners::NavigationOf("mppi", config),
          [config] { return planners::MakeLocalPlanner("mppi", config); }};
}

}  // namespace

planners::GuardedRobot GuardedRobotOf(const sim::EnvironmentConfig& environment) {
  // By Gazebo's law a wheel's grip is |cos| of its angle, which nobody on the robot knows.
  constexpr double kMeanOfCosine = 2.0 / std::numbers::pi;
  const sim::RobotConfig& robot = environment.robot;
  const sim::MassDistribution masses = sim::DistributeMass(robot);
  return {.model = {.length = robot.length,
                    .width = robot.width,
                    .mass = masses.mass,
                    .yaw_inertia = masses.yaw_inertia,
                    .centre_x = masses.x,
                    .centre_y = masses.y,
                    .centre_z = masses.height,
                    .wheel_base = robot.wheel_base,
                    .track = robot.track,
                    .wheel_separation_multiplier = robot.wheel_separation_multiplier,
                    .friction = robot.friction == sim::FrictionLaw::kGazebo
                                    ? kMeanOfCosine * robot.wheel_friction
                                    : robot.wheel_friction,
                    .slips = robot.drive == sim::DriveKind::kSkidSteer,
                    .pyramid = robot.friction != sim::FrictionLaw::kCone,
                    .linear_limit = robot.linear_speed_limit,
                    .angular_limit = robot.angular_speed_limit,
                    .linear_acceleration = robot.linear_acceleration,
                    .angular_acceleration = robot.angular_acceleration,
                    .least_delay = robot.command_delay,
                    .delay = robot.command_delay + robot.command_jitter},
          .scan = sim::ScanGeometryOf(environment),
          .bounds = environment.action,
          .step = environment.episode.step};
}

std::unique_ptr<env::Agent> Guarded(std::unique_ptr<env::Agent> agent,
                                    const planners::GuardConfig& guard,
                                    const sim::EnvironmentConfig& environment) {
  RequireRead(guard);
  if (guard.guards()) {
    planners::GuardedRobot robot = GuardedRobotOf(environment);
    robot.guide = GuidePlannerOf(environment, guard);
    agent = std::make_unique<planners::GuardedAgent>(std::move(agent), guard, robot);
  }
  if (!guard.scan_matching) return agent;
  return std::make_unique<planners::ScanMatchingAgent>(std::move(agent),
                                                       sim::ScanGeometryOf(environment));
}

eval::MakeAgent Guarded(eval::MakeAgent make_agent, const planners::GuardConfig& guard) {
  RequireRead(guard);
  if (!guard.enabled()) return make_agent;
  return [make_agent = std::move(make_agent), guard](const sim::CourseEnvironments& environments) {
    return Guarded(make_agent(environments), guard, environments.config());
  };
}

}  // namespace slalom::train
