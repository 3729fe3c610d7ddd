#pragma once

#include "base/config_field.h"
#include "planners/navigation/footprint.h"

namespace slalom::planners {

/// Settings of the navigation system around a local planner: costmaps, global planner and the state
/// machine of ROS's move_base. Defaults are from docs/original-system.md, section 8.2 or, if it
/// gives none, from the ROS packages (melodic).
struct NavigationConfig {
  FootprintConfig footprint;
  double start_heading = 1.57;
  double resolution = 0.05;
  double local_map_size = 10.0;
  double local_map_rate = 20.0;
  double global_map_size = 40.0;
  double global_map_rate = 10.0;
  double scan_age = 0.05;
  double obstacle_range = 2.5;
  double raytrace_range = 3.0;
  double planner_rate = 20.0;
  double planner_patience = 5.0;
  double controller_patience = 15.0;
  double command_timeout = 0.25;
  double command_delay = 0.0;
  double goal_resend_rate = 0.0;
  bool recovery = true;
  bool recovery_clears = false;
  double conservative_reset = 3.0;
  double aggressive_reset = 1.84;
  bool recovery_rotates = true;
  double recovery_max_turn_rate = 1.57;
  double recovery_min_turn_rate = 0.314;
  double recovery_turn_acceleration = 20.0;
  double recovery_yaw_tolerance = 0.157;
  bool marks_stay = false;  ///< Not a key: as in `ObstacleMapConfig`.

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("footprint", footprint, "The robot's outline as the planners see it.");
    v("start_heading", start_heading, base::Range{-3.1416, 3.1416}, "rad",
      "Heading at the start in the frame along whose axes the maps' cells lie. The Jackal's filter "
      "takes the heading of its IMU, so that this frame has the world's axes, and robots start "
      "along y.");
    v("resolution", resolution, base::Range{0.01, 0.5}, "m", "Cell size of both costmaps.");
    v("local_map_size", local_map_size, base::Range{1.0, 50.0}, "m",
      "Side of the costmap that follows the robot.");
    v("local_map_rate", local_map_rate, base::Range{0.5, 100.0}, "Hz",
      "Rate at which the local map is updated.");
    v("global_map_size", global_map_size, base::Range{2.0, 200.0}, "m",
      "Side of the costmap that stays in place, centred on the start. It is larger if the goal is "
      "too far away.");
    v("global_map_rate", global_map_rate, base::Range{0.5, 100.0}, "Hz",
      "Rate at which the global map is updated.");
    v("scan_age", scan_age, base::Range{0.0, 1.0}, "s",
      "Age of a scan when the maps are updated from it, in whole steps of the environment. ROS "
      "waits for transforms that are 0.05 s younger than the scan.");
    v("obstacle_range", obstacle_range, base::Range{0.1, 30.0}, "m",
      "Obstacles that are seen nearer than this are marked in the maps.");
    v("raytrace_range", raytrace_range, base::Range{0.1, 30.0}, "m",
      "Beams clear the cells that they cross up to this distance.");
    v("planner_rate", planner_rate, base::Range{0.1, 100.0}, "Hz", "Rate of global planning.");
    v("planner_patience", planner_patience, base::Range{0.0, 1000.0}, "s",
      "The robot starts a recovery after this time without a plan.");
    v("controller_patience", controller_patience, base::Range{0.0, 1000.0}, "s",
      "The robot starts a recovery after this time without an admissible command.");
    v("command_timeout", command_timeout, base::Range{0.0, 100.0}, "s",
      "While it waits for a plan, the robot keeps its last command for this long, then stops.");
    v("command_delay", command_delay, base::Range{0.0, 2.0}, "s",
      "Time from a command until the robot acts on it. Commands are chosen for the place where the "
      "robot will be by then.");
    v("goal_resend_rate", goal_resend_rate, base::Range{0.0, 100.0}, "Hz",
      "Rate at which the goal is sent again, which restarts patience and recoveries; the BARN "
      "Challenge's launch files do so at 10 Hz. 0: it is sent once, and a robot that gave up stays "
      "where it is.");
    v("recovery", recovery, "Try to recover (clear, rotate, clear, rotate) before giving up.");
    v("recovery_clears", recovery_clears,
      "Whether recoveries clear the maps. The original's do not: they clear a layer named "
      "'obstacles', but its layer is named 'obstacles_layer'.");
    v("conservative_reset", conservative_reset, base::Range{0.1, 50.0}, "m",
      "The first clearing keeps a square of this side around the robot.");
    v("aggressive_reset", aggressive_reset, base::Range{0.1, 50.0}, "m",
      "The second clearing keeps a square of this side (4 x 0.46 m).");
    v("recovery_rotates", recovery_rotates, "Whether recoveries turn the robot once around.");
    v("recovery_max_turn_rate", recovery_max_turn_rate, base::Range{0.01, 10.0}, "rad/s",
      "Fastest turn of a recovery.");
    v("recovery_min_turn_rate", recovery_min_turn_rate, base::Range{0.01, 10.0}, "rad/s",
      "Slowest turn of a recovery.");
    v("recovery_turn_acceleration", recovery_turn_acceleration, base::Range{0.01, 100.0}, "rad/s^2",
      "Deceleration with which a recovery plans to stop its turn.");
    v("recovery_yaw_tolerance", recovery_yaw_tolerance, base::Range{0.001, 1.0}, "rad",
      "A recovery's turn ends once the heading is within this angle of where it began.");
  }
};

/// The settings of navigation that each local planner chooses for itself, in its own config
/// section.
struct PlannerNavigationConfig {
  double control_rate = 20.0;
  double inflation_radius = 0.30;
  double cost_scaling = 10.0;
  double goal_tolerance = 0.25;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("control_rate", control_rate, base::Range{0.5, 100.0}, "Hz",
      "Rate of control cycles; a command is held between them. There is at most one cycle per step "
      "of the environment.");
    v("inflation_radius", inflation_radius, base::Range{0.0, 5.0}, "m",
      "Costs spread this far around obstacles.");
    v("cost_scaling", cost_scaling, base::Range{0.0, 1000.0}, "1/m",
      "How fast costs fall beyond the robot's inscribed radius.");
    v("goal_tolerance", goal_tolerance, base::Range{0.01, 10.0}, "m",
      "The robot stops within this distance of the goal.");
  }
};

}  // namespace slalom::planners
