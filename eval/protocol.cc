#include "eval/protocol.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/check.h"

namespace slalom::eval {
namespace {

constexpr double kChallengeShift = -0.25;  // From x = -2 to x = -2.25, [m].

const Protocol kProtocols[] = {
    {"paper", 80.0, 0.4, true, 0.0, {}},
    {"dwa-runs", 100.0, 0.4, false, 0.0, {}},
    {"barn-challenge", 100.0, 1.0, true, 0.1, {kChallengeShift, 0.0}},
};

}  // namespace

std::span<const Protocol> Protocols() { return kProtocols; }

Protocol ResolveProtocol(const EvaluationConfig& config) {
  const auto* found = std::ranges::find(kProtocols, config.protocol, &Protocol::name);
  SLALOM_CHECK(found != std::end(kProtocols));
  Protocol protocol = *found;
  if (config.time_limit > 0.0) protocol.time_limit = config.time_limit;
  if (config.goal_tolerance > 0.0) protocol.goal_tolerance = config.goal_tolerance;
  return protocol;
}

sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment, const Protocol& protocol) {
  sim::EpisodeConfig& episode = environment.episode;
  const double longest = (protocol.clock_start_distance > 0.0 ? 2.0 : 1.0) * protocol.time_limit;
  episode.max_steps = std::max(1, static_cast<int>(std::lround(longest / episode.step)));
  episode.goal_tolerance = protocol.goal_tolerance;
  episode.collision_ends = protocol.collision_ends;
  return environment;
}

sim::CourseSet WithProtocol(sim::CourseSet courses, const Protocol& protocol) {
  const base::Vec2 shift_W = protocol.start_shift_W;
  if (shift_W == base::Vec2{}) return courses;
  for (std::shared_ptr<const sim::Course>& course : courses.courses) {
    sim::Course shifted = *course;
    shifted.start.p = shifted.start.p + shift_W;
    shifted.goal_W = shifted.goal_W + shift_W;
    course = std::make_shared<const sim::Course>(std::move(shifted));
  }
  return courses;
}

}  // namespace slalom::eval
