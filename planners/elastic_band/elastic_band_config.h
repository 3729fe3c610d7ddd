#pragma once

#include <memory>

#include "base/config_field.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"

namespace slalom::planners {

/// The elastic band of eband_local_planner for a differential drive, with the plug-in's defaults
/// (docs/original-system.md, section 8.3). The plug-in's settings k_damp, virtual_mass, Ctrl_Rate
/// and the accelerations are absent, as its controller for that drive does not use them. RJ-bench
/// has max_speed 2 and max_turn_rate 3.14.
struct ElasticBandConfig {
  PlannerNavigationConfig navigation{.goal_tolerance = 0.1};
  double min_overlap = 0.7;
  double tiny_bubble = 0.01;
  double internal_force = 1.0;
  double external_force = 2.0;
  int num_iterations = 3;
  int max_equilibrium_depth = 4;
  double equilibrium_overshoot = 0.75;
  double significant_force = 0.15;
  double costmap_weight = 10.0;
  double max_speed = 0.75;
  double min_speed = 0.1;
  double max_turn_rate = 1.0;
  double min_turn_rate = 0.0;
  double min_turn_rate_in_place = 0.0;
  double turn_gain = 4.0;
  double speed_per_radius = 2.0;
  double turn_threshold_scale = 1.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("navigation", navigation, "Rate, inflation and goal tolerance with E-band.");
    v("min_overlap", min_overlap, base::Range{0.01, 1.0}, "",
      "Bubbles are connected if their distance is below this times the sum of their radii.");
    v("tiny_bubble", tiny_bubble, base::Range{0.0, 1.0}, "m",
      "A bubble with a smaller radius counts as a collision.");
    v("internal_force", internal_force, base::Range{0.0, 100.0}, "",
      "Gain of the force that straightens the band.");
    v("external_force", external_force, base::Range{0.0, 100.0}, "",
      "Gain of the force away from obstacles.");
    v("num_iterations", num_iterations, base::Range{0, 100}, "",
      "Passes over the band per control cycle.");
    v("max_equilibrium_depth", max_equilibrium_depth, base::Range{0, 20}, "",
      "How often the step towards a bubble's equilibrium may be halved.");
    v("equilibrium_overshoot", equilibrium_overshoot, base::Range{0.0, 10.0}, "",
      "The step is halved if the force has turned around and still has more than this share of its "
      "strength.");
    v("significant_force", significant_force, base::Range{0.0, 100.0}, "",
      "Weaker forces are ignored.");
    v("costmap_weight", costmap_weight, base::Range{0.1, 100.0}, "1/m",
      "A cost c counts as a distance of ln(252 / c) / costmap_weight; a cost of 0 counts as 1.");
    v("max_speed", max_speed, base::Range{0.01, 5.0}, "m/s", "Largest forward speed.");
    v("min_speed", min_speed, base::Range{0.0, 5.0}, "m/s", "Smallest forward speed.");
    v("max_turn_rate", max_turn_rate, base::Range{0.01, 10.0}, "rad/s", "Largest turn rate.");
    v("min_turn_rate", min_turn_rate, base::Range{0.0, 10.0}, "rad/s",
      "Smallest turn rate while driving.");
    v("min_turn_rate_in_place", min_turn_rate_in_place, base::Range{0.0, 10.0}, "rad/s",
      "Smallest turn rate on the spot.");
    v("turn_gain", turn_gain, base::Range{0.0, 100.0}, "1/s",
      "Turn rate per angle to the next bubble (k_prop).");
    v("speed_per_radius", speed_per_radius, base::Range{0.0, 100.0}, "1/m",
      "Share of max_speed per metre of 0.7 times the bubble's radius "
      "(bubble_velocity_multiplier).");
    v("turn_threshold_scale", turn_threshold_scale, base::Range{0.0, 100.0}, "",
      "The robot turns on the spot if the next bubble is off its heading by more than this times "
      "the angle that 0.7 times the bubble's radius spans.");
  }
};

/// Makes the planner, for the registry.
std::unique_ptr<LocalPlanner> MakePlanner(const ElasticBandConfig& config,
                                          const NavigationConfig& navigation);

}  // namespace slalom::planners
