#pragma once

#include <cstdint>
#include <string>

#include "base/config_field.h"

namespace slalom::eval {

/// Settings of an evaluation (docs/evaluation.md).
struct EvaluationConfig {
  std::string protocol = "paper";
  int episodes_per_course = 10;
  std::int64_t seed = 1;
  double time_limit = 0.0;
  double goal_tolerance = 0.0;
  double start_position_jitter = 0.05;
  double start_yaw_jitter = 0.05;
  int num_environments = 64;
  int recorded_episodes_per_course = 1;
  int recorded_scan_courses = 6;
  int recorded_beams = 90;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("protocol", protocol, base::OneOf{"paper", "dwa-runs", "barn-challenge"}, "",
      "The rules: time limit, goal, start, and what a collision does (docs/evaluation.md).");
    v("episodes_per_course", episodes_per_course, base::Range{1, 100000}, "",
      "Episodes on each course.");
    v("seed", seed, base::Range{0, 9.0e15}, "",
      "Seed from which the evaluation's own random streams are derived.");
    v("time_limit", time_limit, base::Range{0.0, 100000.0}, "s",
      "Time limit in place of the protocol's. 0: the protocol's.");
    v("goal_tolerance", goal_tolerance, base::Range{0.0, 10.0}, "m",
      "Goal tolerance in place of the protocol's. 0: the protocol's.");
    v("start_position_jitter", start_position_jitter, base::Range{0.0, 1.0}, "m",
      "Half width of the uniform error of the start position, along x and y.");
    v("start_yaw_jitter", start_yaw_jitter, base::Range{0.0, 3.14}, "rad",
      "Half width of the uniform error of the start heading.");
    v("num_environments", num_environments, base::Range{1, 4096}, "",
      "Episodes driven side by side. This changes the speed of the evaluation, not what happens in "
      "the episodes.");
    v("recorded_episodes_per_course", recorded_episodes_per_course, base::Range{0, 100000}, "",
      "Episodes of each course whose trajectory is kept: the first that failed, then the first "
      "that succeeded.");
    v("recorded_scan_courses", recorded_scan_courses, base::Range{0, 100000}, "",
      "Courses, evenly spread over the set, on which one episode (the first that failed, else the "
      "first) keeps its scans.");
    v("recorded_beams", recorded_beams, base::Range{2, 4096}, "",
      "Approximate number of beams that are kept of each scan: every n-th.");
  }
};

}  // namespace slalom::eval
