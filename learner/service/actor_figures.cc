#include "learner/service/actor_figures.h"

#include <algorithm>
#include <limits>

namespace slalom::learner {
namespace {

/// NaN if the role does not report it.
double Figure(const proto::RoleStatus& role, const char* key) {
  const auto it = role.report.figures.find(key);
  return it == role.report.figures.end() ? std::numeric_limits<double>::quiet_NaN() : it->second;
}

/// Returns the episodes that a role reports, within range, as a peer may report any number.
std::int64_t NumEpisodes(const proto::RoleStatus& role) {
  constexpr double kMost = 9e15;
  const double told = Figure(role, "episodes");
  return told > 0.0 ? static_cast<std::int64_t>(std::min(told, kMost)) : 0;
}

bool IsActor(const proto::RoleStatus& role) {
  return role.report.role == "actor" && role.connected;
}

}  // namespace

ActorFigures Summarise(const proto::StatusReply& status) {
  ActorFigures sum;
  int num_known = 0;
  for (const proto::RoleStatus& role : status.roles) {
    if (!IsActor(role)) continue;
    sum.num_episodes += NumEpisodes(role);
    if (!role.report.figures.contains("success_rate")) continue;
    ++num_known;
    sum.success_rate += Figure(role, "success_rate");
    sum.collision_rate += Figure(role, "collision_rate");
    sum.timeout_rate += Figure(role, "timeout_rate");
    sum.mean_return += Figure(role, "mean_return");
    sum.mean_cost += Figure(role, "mean_cost");
    sum.mean_length += Figure(role, "mean_length");
  }
  const double share = num_known > 0 ? 1.0 / num_known : std::numeric_limits<double>::quiet_NaN();
  sum.success_rate *= share;
  sum.collision_rate *= share;
  sum.timeout_rate *= share;
  sum.mean_return *= share;
  sum.mean_cost *= share;
  sum.mean_length *= share;
  return sum;
}

std::int64_t FinishedEpisodes::Take(const proto::StatusReply& status) {
  std::int64_t finished = 0;
  for (const proto::RoleStatus& role : status.roles) {
    if (!IsActor(role)) continue;
    const std::int64_t count = NumEpisodes(role);
    const auto [it, is_new] = seen_.try_emplace(role.report.name, count);
    if (!is_new) finished += count < it->second ? count : count - it->second;
    it->second = count;
  }
  return finished;
}

}  // namespace slalom::learner
