#pragma once

#include <span>
#include <string_view>

#include "base/geometry.h"
#include "eval/evaluation_config.h"
#include "sim/course.h"
#include "sim/environment_config.h"

/// What an episode of an evaluation is, whoever drives: docs/evaluation.md gives the sources.

namespace slalom::eval {

/// The rules of an episode. A value.
struct Protocol {
  std::string_view name;
  double time_limit = 80.0;           ///< [s]
  double goal_tolerance = 0.4;        ///< The goal is reached nearer than this, [m].
  bool collision_ends = true;         ///< False: a collision is counted and the episode goes on.
  double clock_start_distance = 0.0;  ///< The clock starts when the robot is this far from its
                                      ///< start, [m]; 0: with the episode.
  base::Vec2 start_shift_W;           ///< Start and goal of every course are moved by this, [m].

  friend bool operator==(const Protocol&, const Protocol&) = default;
};

/// All of them, those of `EvaluationConfig::protocol`:
///
/// - "paper": 80 s, goal within 0.4 m, a collision ends it (docs/original-system.md, section 1.4);
/// - "dwa-runs": of the published runs of DWA, 100 s and not stopped by collisions (section 8.5
/// there);
/// - "barn-challenge": 100 s from the moment when the robot has moved 0.1 m, goal within 1 m, start
///   and goal 0.25 m further left in the original's field, (-2.25, 3) (sections 1.4 and 8.6).
std::span<const Protocol> Protocols();

/// The protocol that `config` names, with the values that it gives in its own place.
/// Requires: config.protocol is the name of one (`config/` checks it).
Protocol ResolveProtocol(const EvaluationConfig& config);

/// The task's config under the evaluation's rules: `environment` with time limit, goal tolerance,
/// collisions and start errors of `config` in the place of its own. A protocol whose clock starts
/// late gives the robot as long again to start moving.
sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment,
                                    const EvaluationConfig& config);

/// The courses with start and goal where the protocol wants them.
sim::CourseSet WithProtocol(sim::CourseSet courses, const EvaluationConfig& config);

}  // namespace slalom::eval
