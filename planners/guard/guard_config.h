#pragma once

#include <string>

#include "base/config_field.h"

namespace slalom::planners {

/// Settings of a guard (planners/guard/guarded_agent.h).
struct GuardConfig {
  bool shield = false;
  double margin = 0.05;
  double memory = 10.0;
  bool tracking = false;
  bool waypoints = false;
  double waypoint_after = 8.0;
  double lookahead = 3.0;
  double obstacle_range = 4.5;
  double raytrace_range = 5.0;
  double turn_beyond = 1.6;
  double rescue_after = 3.0;
  double rescue_time = 3.0;
  double near = 1.0;
  bool scan_matching = false;

  /// Whether it checks actions or shows the way.
  bool guards() const { return shield || waypoints; }
  bool enabled() const { return guards() || scan_matching; }
  /// What reports say of it behind an agent's name.
  std::string label() const {
    return std::string(guards() ? ", guarded" : "") + (scan_matching ? ", scan matching" : "");
  }

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf with_shield{"shield"}, with_waypoints{"waypoints"};
    v("shield", shield,
      "Check each action against the scan before the robot gets it, and replace one that would "
      "bring it too close to something (docs/safety.md).");
    v("margin", margin, base::Range{0.0, 0.5}, "m",
      "Room that the outline keeps to each point of the scan until the robot could have braked. A "
      "slow robot keeps less, at least a quarter, and one that is closer may go on as long as it "
      "comes no closer.",
      with_shield);
    v("memory", memory, base::Range{0.0, 60.0}, "s",
      "How long points are remembered where the range finder does not look, such as behind, not "
      "counting the time for which the robot stands.",
      with_shield);
    v("tracking", tracking,
      "Tell from the scans what moves, expect it to go on as it does, and evade it "
      "(docs/safety.md).",
      with_shield);
    v("waypoints", waypoints,
      "Show the way to a robot that does not get on: points of a path over what the scans have "
      "shown, in place of the goal (docs/safety.md).");
    v("waypoint_after", waypoint_after, base::Range{0.0, 1e6}, "s",
      "Without coming nearer to the goal for this time. 0: from the start, for places where "
      "nothing moves.",
      with_waypoints);
    v("lookahead", lookahead, base::Range{0.5, 100.0}, "m",
      "How far ahead along the path the waypoint is.", with_waypoints);
    v("obstacle_range", obstacle_range, base::Range{0.1, 30.0}, "m",
      "Obstacles that are seen nearer than this are marked in the map of the path.",
      with_waypoints);
    v("raytrace_range", raytrace_range, base::Range{0.1, 30.0}, "m",
      "Beams clear the cells of that map that they cross up to this distance.", with_waypoints);
    v("turn_beyond", turn_beyond, base::Range{0.7, 3.1416}, "rad",
      "The robot turns on the spot towards a waypoint that is farther than this to the side.",
      with_waypoints);
    v("rescue_after", rescue_after, base::Range{0.1, 1000.0}, "s",
      "MPPI drives for a while if the robot has stayed where it is for this time, or its way has "
      "not become shorter for twice as long.",
      with_waypoints);
    v("rescue_time", rescue_time, base::Range{0.0, 1000.0}, "s",
      "For how long MPPI drives then, the first time in an episode; twice as long the second time, "
      "and so on.",
      with_waypoints);
    v("near", near, base::Range{0.0, 100.0}, "m",
      "Once the robot has been at its goal, as it believes, it is left to itself within this "
      "distance of it.",
      with_waypoints);
    v("scan_matching", scan_matching,
      "Show the agent its pose and its goal as each scan, matched to a map of the earlier ones, "
      "corrects them where the odometry drifts (docs/localisation.md).");
  }
};

}  // namespace slalom::planners
