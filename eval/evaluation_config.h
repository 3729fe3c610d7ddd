#pragma once

#include <cstdint>

#include "base/config_field.h"

namespace slalom::eval {

/// The protocol of an evaluation (docs/evaluation.md).
struct EvaluationConfig {
  int episodes_per_course = 10;
  std::int64_t seed = 1;
  double start_position_jitter = 0.05;
  double start_yaw_jitter = 0.05;
  int num_environments = 64;
  int recorded_episodes_per_course = 1;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("episodes_per_course", episodes_per_course, base::Range{1, 100000}, "",
      "Episodes on each course.");
    v("seed", seed, base::Range{0, 9.0e15}, "", "Root of the evaluation's own random streams.");
    v("start_position_jitter", start_position_jitter, base::Range{0.0, 1.0}, "m",
      "Half width of the uniform error of the start position, along x and y.");
    v("start_yaw_jitter", start_yaw_jitter, base::Range{0.0, 3.14}, "rad",
      "Half width of the uniform error of the start heading.");
    v("num_environments", num_environments, base::Range{1, 4096}, "",
      "Episodes driven side by side; changes the speed, not the episodes.");
    v("recorded_episodes_per_course", recorded_episodes_per_course, base::Range{0, 100000}, "",
      "Episodes of each course whose trajectory is kept for pictures.");
  }
};

}  // namespace slalom::eval
