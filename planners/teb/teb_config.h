#pragma once

#include <memory>

#include "base/config_field.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"

/// Defaults are the settings with which PRIEST's authors ran TEB on BARN (docs/original-system.md,
/// section 8.4; the repositories of the benchmark's authors hold no TEB configuration). If section
/// 8.4 gives no value, the default is teb_local_planner's own.

namespace slalom::planners {

/// The robot's limits as TEB assumes them.
struct TebRobotConfig {
  double max_linear = 0.6;
  double max_backward = 0.2;
  double max_angular = 0.3;
  double max_acceleration = 1.0;
  double max_angular_acceleration = 0.5;
  double outline_length = 0.458;
  double outline_width = 0.416;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("max_linear", max_linear, base::Range{0.01, 5.0}, "m/s", "Forward speed limit.");
    v("max_backward", max_backward, base::Range{0.01, 5.0}, "m/s", "Backward speed limit.");
    v("max_angular", max_angular, base::Range{0.01, 10.0}, "rad/s", "Turn rate limit.");
    v("max_acceleration", max_acceleration, base::Range{0.01, 1000.0}, "m/s^2",
      "Largest change of speed.");
    v("max_angular_acceleration", max_angular_acceleration, base::Range{0.01, 1000.0}, "rad/s^2",
      "Largest change of turn rate.");
    v("outline_length", outline_length, base::Range{0.05, 3.0}, "m",
      "Length of the rectangle that is checked for collisions before driving. The optimiser itself "
      "treats the robot as a point.");
    v("outline_width", outline_width, base::Range{0.05, 3.0}, "m", "Width of that rectangle.");
  }
};

/// The band and its horizon.
struct TebTrajectoryConfig {
  double dt_ref = 0.3;
  double dt_hysteresis = 0.1;
  int min_samples = 3;
  int max_samples = 500;
  double look_ahead = 3.0;
  double via_point_separation = 0.0;
  double reinit_distance = 1.0;
  double reinit_angle = 1.5708;
  int feasibility_check_poses = 5;
  bool shrink_horizon = true;
  double shrink_horizon_duration = 10.0;
  double control_period = 0.05;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("dt_ref", dt_ref, base::Range{0.01, 2.0}, "s", "Desired time between two poses.");
    v("dt_hysteresis", dt_hysteresis, base::Range{0.001, 1.0}, "s",
      "How far the time between two poses may be from dt_ref before a pose is inserted or "
      "removed.");
    v("min_samples", min_samples, base::Range{3, 1000}, "", "Smallest number of poses.");
    v("max_samples", max_samples, base::Range{3, 10000}, "", "Largest number of poses.");
    v("look_ahead", look_ahead, base::Range{0.1, 100.0}, "m",
      "Length of the global plan that the band spans.");
    v("via_point_separation", via_point_separation, base::Range{0.0, 100.0}, "m",
      "Distance between the points of the global plan that attract the band. 0: none do.");
    v("reinit_distance", reinit_distance, base::Range{0.0, 100.0}, "m",
      "A new band is made if its goal has moved by more than this.");
    v("reinit_angle", reinit_angle, base::Range{0.0, 3.1416}, "rad",
      "A new band is made if its goal has turned by more than this.");
    v("feasibility_check_poses", feasibility_check_poses, base::Range{1, 1000}, "",
      "Poses of the chosen band at which the robot's outline must be free.");
    v("shrink_horizon", shrink_horizon, "Halve the horizon for a while after an infeasible band.");
    v("shrink_horizon_duration", shrink_horizon_duration, base::Range{0.0, 1000.0}, "s",
      "Shortest time for which the horizon stays halved.");
    v("control_period", control_period, base::Range{0.001, 1.0}, "s",
      "Time between two control cycles, with which shrink_horizon_duration is counted.");
  }
};

/// Distances that the band keeps.
struct TebObstacleConfig {
  double min_distance = 0.25;
  double inflation_distance = 0.6;
  double cost_exponent = 1.0;
  double behind_robot_distance = 1.5;
  double force_inclusion_factor = 1.5;
  double cutoff_factor = 5.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("min_distance", min_distance, base::Range{0.0, 10.0}, "m",
      "Desired distance between the robot's centre and a lethal cell.");
    v("inflation_distance", inflation_distance, base::Range{0.0, 10.0}, "m",
      "Obstacles nearer than this push the band softly.");
    v("cost_exponent", cost_exponent, base::Range{1.0, 10.0}, "",
      "Exponent of the share by which min_distance is violated.");
    v("behind_robot_distance", behind_robot_distance, base::Range{0.0, 100.0}, "m",
      "Lethal cells farther behind the robot than this are ignored.");
    v("force_inclusion_factor", force_inclusion_factor, base::Range{0.0, 100.0}, "",
      "All cells nearer to a pose than this times min_distance act on the pose.");
    v("cutoff_factor", cutoff_factor, base::Range{0.0, 100.0}, "",
      "Of the other cells nearer than this times min_distance, only the nearest on the left and on "
      "the right do.");
  }
};

/// The least-squares problem and its solver.
struct TebOptimizerConfig {
  int inner_iterations = 5;
  int outer_iterations = 4;
  double penalty_epsilon = 0.1;
  double weight_max_linear = 2.0;
  double weight_max_angular = 1.0;
  double weight_acceleration = 1.0;
  double weight_angular_acceleration = 1.0;
  double weight_nonholonomic = 1000.0;
  double weight_forward_drive = 1.0;
  double weight_time = 1.0;
  double weight_shortest_path = 0.0;
  double weight_obstacle = 100.0;
  double weight_inflation = 0.1;
  double weight_via_point = 1.0;
  double weight_adapt_factor = 2.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("inner_iterations", inner_iterations, base::Range{1, 100}, "",
      "Levenberg-Marquardt steps between two resizings of the band.");
    v("outer_iterations", outer_iterations, base::Range{1, 100}, "", "Resizings per cycle.");
    v("penalty_epsilon", penalty_epsilon, base::Range{0.0, 1.0}, "",
      "Margin before a limit, in the limit's own unit, in which a cost already arises.");
    v("weight_max_linear", weight_max_linear, base::Range{0.0, 1e6}, "",
      "Weight of the speed limits.");
    v("weight_max_angular", weight_max_angular, base::Range{0.0, 1e6}, "",
      "Weight of the turn rate limit.");
    v("weight_acceleration", weight_acceleration, base::Range{0.0, 1e6}, "",
      "Weight of the acceleration limit.");
    v("weight_angular_acceleration", weight_angular_acceleration, base::Range{0.0, 1e6}, "",
      "Weight of the limit on the turn rate's change.");
    v("weight_nonholonomic", weight_nonholonomic, base::Range{0.0, 1e6}, "",
      "Weight of successive poses lying on a common arc.");
    v("weight_forward_drive", weight_forward_drive, base::Range{0.0, 1e6}, "",
      "Weight of driving forwards.");
    v("weight_time", weight_time, base::Range{0.0, 1e6}, "", "Weight of each time difference.");
    v("weight_shortest_path", weight_shortest_path, base::Range{0.0, 1e6}, "",
      "Weight of each distance between poses.");
    v("weight_obstacle", weight_obstacle, base::Range{0.0, 1e6}, "",
      "Weight of keeping min_distance.");
    v("weight_inflation", weight_inflation, base::Range{0.0, 1e6}, "",
      "Weight of keeping inflation_distance.");
    v("weight_via_point", weight_via_point, base::Range{0.0, 1e6}, "",
      "Weight of passing near via-points.");
    v("weight_adapt_factor", weight_adapt_factor, base::Range{1.0, 100.0}, "",
      "Factor by which weight_obstacle grows with every resizing.");
  }
};

/// Search for bands that pass obstacles on other sides.
struct TebHomotopyConfig {
  bool enabled = true;
  int max_classes = 4;
  int roadmap_samples = 15;
  double roadmap_width = 6.0;
  double heading_threshold = 0.45;
  int max_roadmap_paths = 500;
  double cost_hysteresis = 1.0;
  double prefer_initial_plan = 0.95;
  double obstacle_cost_scale = 100.0;
  double switching_blocking_period = 0.0;
  double detour_angle = 1.5708;
  double max_detour_ratio = 3.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("enabled", enabled, "Whether to search. Otherwise only the global plan's class is followed.");
    v("max_classes", max_classes, base::Range{1, 20}, "", "Largest number of bands at a time.");
    v("roadmap_samples", roadmap_samples, base::Range{0, 200}, "", "Points drawn per cycle.");
    v("roadmap_width", roadmap_width, base::Range{0.1, 100.0}, "m",
      "Width of the area between the robot and the local goal in which points are drawn.");
    v("heading_threshold", heading_threshold, base::Range{0.0, 1.0}, "",
      "Cosine above which an edge counts as leading towards the goal.");
    v("max_roadmap_paths", max_roadmap_paths, base::Range{1, 1000000}, "",
      "Most paths through the roadmap that are examined per cycle.");
    v("cost_hysteresis", cost_hysteresis, base::Range{0.0, 1.0}, "",
      "Factor on the current band's cost when bands are compared; below 1, the band is kept more "
      "readily.");
    v("prefer_initial_plan", prefer_initial_plan, base::Range{0.0, 1.0}, "",
      "Factor on the cost of the global plan's class when bands are compared.");
    v("obstacle_cost_scale", obstacle_cost_scale, base::Range{0.0, 1e6}, "",
      "Factor on the obstacles' part of the cost when bands are compared.");
    v("switching_blocking_period", switching_blocking_period, base::Range{0.0, 1000.0}, "s",
      "Least time between two changes of class.");
    v("detour_angle", detour_angle, base::Range{0.0, 3.1416}, "rad",
      "A band is dropped if its start points away from that of the best band by more than this.");
    v("max_detour_ratio", max_detour_ratio, base::Range{1.0, 1000.0}, "",
      "A band is dropped if it takes this many times as long as the best one.");
  }
};

/// The whole planner.
struct TebConfig {
  TebRobotConfig robot;
  TebTrajectoryConfig trajectory;
  TebObstacleConfig obstacle;
  TebOptimizerConfig optimizer;
  TebHomotopyConfig homotopy;
  PlannerNavigationConfig navigation;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("robot", robot, "The robot's limits as TEB assumes them.");
    v.Section("trajectory", trajectory, "The band and its horizon.");
    v.Section("obstacle", obstacle, "Distances that the band keeps.");
    v.Section("optimizer", optimizer, "The least-squares problem and its solver.");
    v.Section("homotopy", homotopy, "Search for bands on other sides of obstacles.");
    v.Section("navigation", navigation, "Rate, inflation and goal tolerance with TEB.");
  }
};

/// Makes the planner, for the registry.
std::unique_ptr<LocalPlanner> MakePlanner(const TebConfig& config,
                                          const NavigationConfig& navigation);

}  // namespace slalom::planners
