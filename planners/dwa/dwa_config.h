#pragma once

#include <memory>

#include "base/config_field.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"

namespace slalom::planners {

/// ROS's TrajectoryPlannerROS with `dwa` on and the settings of docs/original-system.md,
/// section 8.1. The BARN Challenge's "Fast DWA" has max_speed 1 and speed_samples 12.
struct DwaConfig {
  PlannerNavigationConfig navigation;
  double max_speed = 0.5;
  double min_speed = 0.1;
  double max_turn_rate = 1.57;
  double min_turn_rate_in_place = 0.314;
  double acceleration = 10.0;
  double turn_acceleration = 20.0;
  double sim_time = 2.0;
  double sim_granularity = 0.02;
  double angular_sim_granularity = 0.02;
  int speed_samples = 6;
  int turn_samples = 20;
  double path_distance_scale = 0.75;
  double goal_distance_scale = 1.0;
  double obstacle_cost_scale = 0.1;
  bool meter_scoring = true;
  double heading_lookahead = 0.325;
  double oscillation_reset_distance = 0.05;
  double escape_speed = -0.5;
  double escape_reset_distance = 0.1;
  double escape_reset_angle = 0.1;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("navigation", navigation, "Rate, inflation and goal tolerance with DWA.");
    v("max_speed", max_speed, base::Range{0.01, 5.0}, "m/s",
      "Largest forward speed that is sampled.");
    v("min_speed", min_speed, base::Range{0.0, 5.0}, "m/s",
      "Smallest forward speed that is sampled.");
    v("max_turn_rate", max_turn_rate, base::Range{0.01, 10.0}, "rad/s",
      "Largest turn rate that is sampled, left and right.");
    v("min_turn_rate_in_place", min_turn_rate_in_place, base::Range{0.0, 10.0}, "rad/s",
      "Smallest turn rate on the spot.");
    v("acceleration", acceleration, base::Range{0.01, 1000.0}, "m/s^2",
      "Acceleration that bounds the window of sampled speeds and the simulated change of speed.");
    v("turn_acceleration", turn_acceleration, base::Range{0.01, 1000.0}, "rad/s^2",
      "The same for turn rates.");
    v("sim_time", sim_time, base::Range{0.1, 10.0}, "s", "How far ahead each sample is simulated.");
    v("sim_granularity", sim_granularity, base::Range{0.005, 0.5}, "m",
      "Distance between the simulated poses.");
    v("angular_sim_granularity", angular_sim_granularity, base::Range{0.005, 0.5}, "rad",
      "Each sample is simulated in at least as many poses as its turn rate divided by this.");
    v("speed_samples", speed_samples, base::Range{2, 100}, "",
      "Number of speeds that are sampled.");
    v("turn_samples", turn_samples, base::Range{2, 200}, "",
      "Number of turn rates that are sampled.");
    v("path_distance_scale", path_distance_scale, base::Range{0.0, 100.0}, "",
      "Weight of the distance from a sample's end to the path (pdist_scale).");
    v("goal_distance_scale", goal_distance_scale, base::Range{0.0, 100.0}, "",
      "Weight of the distance from a sample's end to the local goal (gdist_scale).");
    v("obstacle_cost_scale", obstacle_cost_scale, base::Range{0.0, 100.0}, "",
      "Weight of the highest cost under the outline (occdist_scale).");
    v("meter_scoring", meter_scoring,
      "Multiply the weights of the two distances by the map's resolution, as if they were in "
      "metres. The weight of the costmap's value stays as it is.");
    v("heading_lookahead", heading_lookahead, base::Range{0.0, 5.0}, "m",
      "Turns on the spot are compared by the distance to the goal from a point this far ahead of "
      "the robot.");
    v("oscillation_reset_distance", oscillation_reset_distance, base::Range{0.0, 5.0}, "m",
      "After driving this far, the robot may again turn in a direction that it had given up.");
    v("escape_speed", escape_speed, base::Range{-5.0, 0.0}, "m/s",
      "Speed of an escape, which is driven without any check when no sample is admissible.");
    v("escape_reset_distance", escape_reset_distance, base::Range{0.0, 5.0}, "m",
      "An escape ends after driving this far ...");
    v("escape_reset_angle", escape_reset_angle, base::Range{0.0, 6.3}, "rad",
      "... or after turning by this much.");
  }
};

/// Makes the planner, for the registry.
std::unique_ptr<LocalPlanner> MakePlanner(const DwaConfig& config,
                                          const NavigationConfig& navigation);

}  // namespace slalom::planners
