#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "base/geometry.h"
#include "eval/evaluation_config.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"
#include "sim/robot_body.h"

/// Evaluation protocols, which are the rules of an episode, the same for every agent
/// (docs/evaluation.md gives their sources), and the task of an evaluation.

namespace slalom::eval {

/// The rules of an episode. A value.
struct Protocol {
  std::string_view name;
  double time_limit = 80.0;           ///< [s]
  double goal_tolerance = 0.4;        ///< The goal is reached nearer than this, [m].
  bool collision_ends = true;         ///< If false, a collision is counted and the episode goes on.
  double clock_start_distance = 0.0;  ///< The clock starts when the robot is this far from its
                                      ///< start, [m]; 0: when the episode starts.
  base::Vec2 start_shift_W;           ///< Start and goal of every course are moved by this, [m].
  /// Start and goal follow from the course's reference path in place of the course's own: the start
  /// is this far before the path's first point, the goal that far beyond its last, both along the
  /// start's heading, [m]. If both are 0, start and goal are the course's own.
  double run_up = 0.0;
  double run_out = 0.0;
  double finish_ahead = 0.0;  ///< The episode also succeeds when the robot is this far ahead of the
                              ///< course's start, along the start's heading, [m]; 0: it does not.
  double look_period = 0.0;   ///< Success is looked for once in this time, [s]; 0: at each step.

  friend bool operator==(const Protocol&, const Protocol&) = default;
};

/// Returns all protocols, which `EvaluationConfig::protocol` may name:
///
/// - "paper": 80 s, goal within 0.4 m, a collision ends it (docs/original-system.md, section 1.4);
/// - "dwa-runs": as in the published runs of DWA (section 8.5; ros_jackal's commit 7ec56a7, which
///   added them: envs/dwa_base_envs.py, `_set_start_goal_BARN`, `_get_success`, and
///   its laser.yaml). The robot starts 1 m before the first cell of the course's reference path and
///   is sent 5 m beyond the last. Both are moved by (-0.15, -0.10) m, as that code does when it
///   turns cells into positions. The robot succeeds when it is seen beyond y = 11 m, that is 6.925
///   m ahead of its start. It is looked at 100 times, every 1.13 s (a second and the time to set
///   parameters); then the time is up. Collisions stop nothing;
/// - "barn-challenge": 100 s from the moment when the robot has moved 0.1 m, goal within 1 m, start
///   and goal 0.25 m further left in the original's field, (-2.25, 3) (sections 1.4 and 8.6).
std::span<const Protocol> Protocols();

/// Returns the protocol that `config` names, with the values that `config` gives instead of its
/// own. Only `ResolveEvaluation` calls it; the rest gets its result. Throws `base::Error` if the
/// time is up before the protocol first looks for success.
/// Requires: config.protocol is the name of a protocol (`base/config.h` checks it).
Protocol ResolveProtocol(const EvaluationConfig& config);

/// Throws `base::Error` if `key`, as in a config file, is one of the task that the protocol
/// decides: to set it has no effect. The error names the key of [evaluation] for it.
void RefuseRuleOfTask(std::string_view key);

/// Returns `environment` with the protocol's time limit, goal tolerance and rule for collisions. If
/// the protocol's clock starts late, the robot gets the same time once more to start moving.
sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment, const Protocol& protocol);

/// Returns the courses with start and goal moved as the protocol says. Throws `base::Error` if the
/// protocol needs a course's reference path and it has none.
sim::CourseSet WithProtocol(sim::CourseSet courses, const Protocol& protocol);

/// How much of an evaluation is recorded: the keys `recorded_...` of `EvaluationConfig`.
struct Recording {
  int episodes_per_course = 1;
  int scan_courses = 6;
  int beams = 90;
};

/// The courses and rules of an evaluation: an `EvaluationConfig` resolved once. Everything after
/// that (driving, summary, reports, the evaluator's service) gets this value and sees neither the
/// config nor the name of a protocol. A value.
struct EvaluationTask {
  Protocol protocol;
  sim::EnvironmentConfig environment;  ///< With the protocol applied.
  sim::CourseSet courses;              ///< With the protocol's start and goal.
  int episodes_per_course = 10;
  std::int64_t seed = 1;
  int num_environments = 1;  ///< Driven side by side; at most as many as there are episodes.
  Recording recording;
  sim::Physics physics;  ///< Defaults to Slalom's own.

  int num_episodes() const {
    return static_cast<int>(courses.courses.size()) * episodes_per_course;
  }
};

/// Resolves the names in `config` and applies it to the robot's task and the courses as they are.
/// Requires: config.protocol is the name of a protocol (`base/config.h` checks it).
EvaluationTask ResolveEvaluation(const EvaluationConfig& config,
                                 const sim::EnvironmentConfig& environment,
                                 const sim::CourseSet& courses);

}  // namespace slalom::eval
