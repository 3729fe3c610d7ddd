#include "eval/evaluation_task.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/check.h"
#include "base/error.h"

namespace slalom::eval {

namespace {

constexpr double kChallengeShift = -0.25;  // From x = -2 to x = -2.25, [m].

const Protocol kProtocols[] = {
    {"paper", 80.0, 0.4, true, 0.0, {}},
    {.name = "dwa-runs",
     .time_limit = 113.0,
     .goal_tolerance = 0.4,
     .collision_ends = false,
     .start_shift_W = {-0.15, -0.10},
     .run_up = 1.0,
     .run_out = 5.0,
     .finish_ahead = 6.925,
     .look_period = 1.13},
    {"barn-challenge", 100.0, 1.0, true, 0.1, {kChallengeShift, 0.0}},
};

}  // namespace

std::span<const Protocol> Protocols() { return kProtocols; }

Protocol ResolveProtocol(const EvaluationConfig& config) {
  const auto* found = std::ranges::find(kProtocols, config.protocol, &Protocol::name);
  SLALOM_CHECK(found != std::end(kProtocols));
  Protocol protocol = *found;
  if (config.time_limit > 0.0) protocol.time_limit = config.time_limit;
  base::ThrowIf(
      protocol.time_limit < protocol.look_period,
      "evaluation.time_limit is {} s, expected at least {}, as success under protocol {} is "
      "looked for that often",
      protocol.time_limit, protocol.look_period, protocol.name);
  if (config.goal_tolerance > 0.0) protocol.goal_tolerance = config.goal_tolerance;
  return protocol;
}

void RefuseRuleOfTask(std::string_view key) {
  for (const auto& [theirs, ours] : {std::pair{"max_steps", "time_limit"},
                                     {"goal_tolerance", "goal_tolerance"},
                                     {"collision_ends", "protocol"},
                                     {"finish_ahead", "protocol"},
                                     {"look_period", "protocol"},
                                     {"start_position_jitter", "start_position_jitter"},
                                     {"start_yaw_jitter", "start_yaw_jitter"}}) {
    if (key != fmt::format("environment.episode.{}", theirs)) continue;
    throw base::Error(
        "{}: in an evaluation the protocol decides this, not the task; use evaluation.{}", key,
        ours);
  }
}

sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment, const Protocol& protocol) {
  sim::EpisodeConfig& episode = environment.episode;
  const double longest = (protocol.clock_start_distance > 0.0 ? 2.0 : 1.0) * protocol.time_limit;
  episode.max_steps = std::max(1, static_cast<int>(std::lround(longest / episode.step)));
  episode.goal_tolerance = protocol.goal_tolerance;
  episode.collision_ends = protocol.collision_ends;
  episode.finish_ahead = protocol.finish_ahead;
  episode.look_period = protocol.look_period;
  return environment;
}

sim::CourseSet WithProtocol(sim::CourseSet courses, const Protocol& protocol) {
  const base::Vec2 shift_W = protocol.start_shift_W;
  const bool along_path = protocol.run_up > 0.0 || protocol.run_out > 0.0;
  if (shift_W == base::Vec2{} && !along_path) return courses;
  for (std::shared_ptr<const sim::Course>& course : courses.courses) {
    sim::Course shifted = *course;
    if (along_path) {
      if (course->reference_path_W.empty()) {
        throw base::Error(
            "course '{}': has no reference path, expected one because protocol '{}' starts before "
            "its first point and ends beyond its last",
            course->name, protocol.name);
      }
      const auto [s, c] = base::SinCos(course->start.yaw);
      shifted.start.p = course->reference_path_W.front() - protocol.run_up * base::Vec2{c, s};
      shifted.goal_W = course->reference_path_W.back() + protocol.run_out * base::Vec2{c, s};
    }
    shifted.start.p = shifted.start.p + shift_W;
    shifted.goal_W = shifted.goal_W + shift_W;
    course = std::make_shared<const sim::Course>(std::move(shifted));
  }
  return courses;
}

EvaluationTask ResolveEvaluation(const EvaluationConfig& config,
                                 const sim::EnvironmentConfig& environment,
                                 const sim::CourseSet& courses) {
  EvaluationTask task;
  task.protocol = ResolveProtocol(config);
  task.environment = WithProtocol(environment, task.protocol);
  task.environment.episode.start_position_jitter = config.start_position_jitter;
  task.environment.episode.start_yaw_jitter = config.start_yaw_jitter;
  task.courses = WithProtocol(courses, task.protocol);
  task.episodes_per_course = config.episodes_per_course;
  task.seed = config.seed;
  task.num_environments = std::min(config.num_environments, task.num_episodes());
  task.recording = {config.recorded_episodes_per_course, config.recorded_scan_courses,
                    config.recorded_beams};
  return task;
}

}  // namespace slalom::eval
