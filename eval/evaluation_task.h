#pragma once

#include <cstdint>

#include "eval/evaluation_config.h"
#include "eval/protocol.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"
#include "sim/robot_body.h"

namespace slalom::eval {

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

/// Resolves what `config` names and applies it to the robot's task and the courses as they are.
/// Requires: config.protocol is the name of a protocol (`base/config.h` checks it).
EvaluationTask ResolveEvaluation(const EvaluationConfig& config,
                                 const sim::EnvironmentConfig& environment,
                                 const sim::CourseSet& courses);

}  // namespace slalom::eval
