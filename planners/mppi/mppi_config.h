#pragma once

#include <memory>

#include "base/config_field.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"

/// Defaults are as in Nav2's nav2_mppi_controller (its README and sources) unless a comment names
/// another. The others were chosen on generated courses (docs/planners.md);
/// configs/planners/mppi-nav2.toml sets them as Nav2 has them.

namespace slalom::planners {

/// A critic's cost enters as (weight * measure) ^ power.
struct CriticWeight {
  double weight = 1.0;
  int power = 1;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("weight", weight, base::Range{0.0, 1e6}, "", "Factor on what the critic measures.");
    v("power", power, base::Range{1, 4}, "", "Exponent of weight times measure.");
  }
};

/// Speeds beyond the limits.
struct MppiConstraintConfig {
  CriticWeight cost{4.0, 1};

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost,
              "Integral of the speed beyond the limits, [m], and of the lateral acceleration "
              "beyond its limit, [m/s].");
  }
};

/// Nearness to obstacles.
struct MppiObstacleConfig {
  double collision_cost = 1e5;
  double critical_weight = 20.0;
  double repulsion_weight = 1.5;
  int power = 1;
  double collision_margin = 0.05;  // Nav2: 0.1, which shuts gaps that the robot fits through.
  double inflation_radius = 0.55;
  double near_goal_distance = 0.5;
  int point_step = 2;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("collision_cost", collision_cost, base::Range{0.0, 1e9}, "",
      "Cost of a rollout whose outline meets an obstacle.");
    v("critical_weight", critical_weight, base::Range{0.0, 1e6}, "1/m",
      "Cost per metre by which the outline is nearer than collision_margin, summed over the "
      "points.");
    v("repulsion_weight", repulsion_weight, base::Range{0.0, 1e6}, "1/m",
      "Cost per metre by which the inscribed circle is nearer than inflation_radius, averaged over "
      "the points.");
    v("power", power, base::Range{1, 4}, "", "Exponent of the two terms' sum.");
    v("collision_margin", collision_margin, base::Range{0.0, 1.0}, "m",
      "Clearance of the outline below which a point is critical.");
    v("inflation_radius", inflation_radius, base::Range{0.01, 2.0}, "m",
      "Clearance of the inscribed circle below which obstacles repel.");
    v("near_goal_distance", near_goal_distance, base::Range{0.0, 100.0}, "m",
      "If the goal is nearer than this, only critical points and collisions count.");
    v("point_step", point_step, base::Range{1, 50}, "",
      "Only every n-th point of a rollout is examined, with this n.");
  }
};

/// Distance to the goal.
struct MppiGoalConfig {
  CriticWeight cost{5.0, 1};
  double threshold = 1.4;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost, "Mean distance of the rollout's points to the goal, [m].");
    v("threshold", threshold, base::Range{0.0, 100.0}, "m",
      "The critic counts only if the goal is nearer than this.");
  }
};

/// Distance between a rollout and the path, at equal lengths along both.
struct MppiPathAlignConfig {
  CriticWeight cost{10.0, 1};
  double threshold = 0.5;
  int offset_from_furthest = 20;
  int point_step = 4;
  double max_occupancy_ratio = 0.07;
  double occupancy_check_distance = 2.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost,
              "Mean distance between the rollout's points and those of the path, [m].");
    v("threshold", threshold, base::Range{0.0, 100.0}, "m",
      "The critic counts only if more than this of the path is left.");
    v("offset_from_furthest", offset_from_furthest, base::Range{0, 1000}, "",
      "The critic counts only once a rollout gets this many path points ahead.");
    v("point_step", point_step, base::Range{1, 50}, "",
      "Only every n-th point of a rollout is examined, with this n.");
    v("max_occupancy_ratio", max_occupancy_ratio, base::Range{0.0, 1.0}, "",
      "The critic does not count if more than this share of the path is blocked.");
    v("occupancy_check_distance", occupancy_check_distance, base::Range{0.0, 100.0}, "m",
      "Least length of the path that is examined for max_occupancy_ratio.");
  }
};

/// Progress along the path.
struct MppiPathFollowConfig {
  CriticWeight cost{5.0, 1};
  double threshold = 1.4;
  int offset_from_furthest = 6;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost,
              "Distance from the rollout's end to a path point ahead of the furthest one that any "
              "rollout reaches, [m].");
    v("threshold", threshold, base::Range{0.0, 100.0}, "m",
      "The critic counts only if more than this of the path is left.");
    v("offset_from_furthest", offset_from_furthest, base::Range{0, 1000}, "",
      "How many path points that point is ahead of the furthest one.");
  }
};

/// Heading towards the path.
struct MppiPathAngleConfig {
  CriticWeight cost{2.2, 1};
  double threshold = 0.5;
  int offset_from_furthest = 4;
  double max_angle = 0.785398;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost,
              "Angle at the rollout's end between its heading and the direction to a path point "
              "ahead, [rad].");
    v("threshold", threshold, base::Range{0.0, 100.0}, "m",
      "The critic counts only if the goal is farther away than this.");
    v("offset_from_furthest", offset_from_furthest, base::Range{0, 1000}, "",
      "How many path points that point is ahead of the furthest one reached.");
    v("max_angle", max_angle, base::Range{0.0, 3.1416}, "rad",
      "The critic counts only if the robot's own heading is off that point by more than this.");
  }
};

/// Backward driving.
struct MppiPreferForwardConfig {
  CriticWeight cost{5.0, 1};
  double threshold = 0.5;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("cost", cost, "Distance driven backwards, [m].");
    v("threshold", threshold, base::Range{0.0, 100.0}, "m",
      "The critic counts only if the goal is farther away than this.");
  }
};

/// The whole controller.
struct MppiConfig {
  // A wider slope of costs keeps the global plan off obstacles where there is room.
  PlannerNavigationConfig navigation{.inflation_radius = 0.5, .cost_scaling = 5.0};
  // The robot: its outline and speeds, not Nav2's TurtleBot.
  double outline_length = 0.458;
  double outline_width = 0.416;
  double max_linear = 1.5;
  double min_linear = -1.0;
  double max_angular = 3.14;
  double max_acceleration = 4.5;  // Grip of wheels with friction 0.5: 4.9 m/s^2.
  double max_angular_acceleration = 20.0;
  double max_lateral_acceleration = 2.0;
  // Sampling and optimisation. The horizon and the deviations fit 2 m/s; Nav2's, for 0.5 m/s, are
  // 56 steps, 0.2 m/s and 0.4 rad/s.
  int batch_size = 1000;
  int num_steps = 30;
  double model_dt = 0.05;
  int num_iterations = 1;
  int num_retries = 1;
  double linear_std = 0.4;
  double angular_std = 0.8;
  double temperature = 0.3;
  double gamma = 0.015;
  double validation_time = 1.0;
  // Path. It bounds the speed by prune_distance over the horizon's time; Nav2: 1.5 m.
  double prune_distance = 3.0;
  double path_spacing = 0.05;
  MppiConstraintConfig constraint;
  MppiObstacleConfig obstacle;
  MppiGoalConfig goal;
  MppiPathAlignConfig path_align;
  MppiPathFollowConfig path_follow;
  MppiPathAngleConfig path_angle;
  MppiPreferForwardConfig prefer_forward;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("navigation", navigation, "Rate, inflation and goal tolerance with MPPI.");
    v("outline_length", outline_length, base::Range{0.05, 3.0}, "m",
      "Length of the rectangle that must stay clear.");
    v("outline_width", outline_width, base::Range{0.05, 3.0}, "m", "Width of that rectangle.");
    v("max_linear", max_linear, base::Range{0.01, 5.0}, "m/s", "Forward speed limit.");
    v("min_linear", min_linear, base::Range{-5.0, 0.0}, "m/s", "Backward speed limit.");
    v("max_angular", max_angular, base::Range{0.01, 10.0}, "rad/s", "Turn rate limit.");
    v("max_acceleration", max_acceleration, base::Range{0.01, 1000.0}, "m/s^2",
      "Largest change of forward speed.");
    v("max_angular_acceleration", max_angular_acceleration, base::Range{0.01, 1000.0}, "rad/s^2",
      "Largest change of turn rate.");
    v("max_lateral_acceleration", max_lateral_acceleration, base::Range{0.1, 1000.0}, "m/s^2",
      "Lateral acceleration (speed times turn rate) beyond which the constraint critic adds a "
      "cost, as a skid-steered robot then slides. Nav2 has no such limit.");
    v("batch_size", batch_size, base::Range{1, 100000}, "", "Rollouts per iteration.");
    v("num_steps", num_steps, base::Range{10, 1000}, "", "Points of a rollout.");
    v("model_dt", model_dt, base::Range{0.001, 1.0}, "s",
      "Time between two points; should be the control period, as the sequence is shifted by one "
      "each cycle.");
    v("num_iterations", num_iterations, base::Range{1, 100}, "",
      "Updates of the sequence per cycle.");
    v("num_retries", num_retries, base::Range{0, 100}, "",
      "How often to start afresh if all rollouts collide.");
    v("linear_std", linear_std, base::Range{1e-3, 10.0}, "m/s",
      "Standard deviation of the sampled speeds.");
    v("angular_std", angular_std, base::Range{1e-3, 10.0}, "rad/s",
      "Standard deviation of the sampled turn rates.");
    v("temperature", temperature, base::Range{1e-6, 1e6}, "",
      "Temperature of the softmax over rollouts: a low one takes the best rollout, a high one the "
      "mean of all.");
    v("gamma", gamma, base::Range{0.0, 1e3}, "",
      "Weight of smooth against low-energy control in the information-theoretic term.");
    v("validation_time", validation_time, base::Range{0.0, 100.0}, "s",
      "First part of the averaged rollout that must be free of collisions; otherwise the best "
      "rollout is driven.");
    v("prune_distance", prune_distance, base::Range{0.1, 100.0}, "m",
      "Length of the path ahead that the critics see.");
    v("path_spacing", path_spacing, base::Range{0.01, 1.0}, "m",
      "Distance between the points of that path.");
    v.Section("constraint", constraint, "Speeds beyond the limits.");
    v.Section("obstacle", obstacle, "Nearness to obstacles.");
    v.Section("goal", goal, "Distance to the goal.");
    v.Section("path_align", path_align, "Distance between the rollout and the path.");
    v.Section("path_follow", path_follow, "Progress along the path.");
    v.Section("path_angle", path_angle, "Heading towards the path.");
    v.Section("prefer_forward", prefer_forward, "Backward driving.");
  }
};

/// Makes the planner, for the registry.
std::unique_ptr<LocalPlanner> MakePlanner(const MppiConfig& config,
                                          const NavigationConfig& navigation);

}  // namespace slalom::planners
