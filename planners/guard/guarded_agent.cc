#include "planners/guard/guarded_agent.h"

#include <fmt/format.h>

#include <utility>

#include "base/check.h"

namespace slalom::planners {

GuardedAgent::GuardedAgent(std::unique_ptr<env::Agent> agent, const GuardConfig& config,
                           const GuardedRobot& robot)
    : agent_(std::move(agent)), config_(config), robot_(robot) {}

GuardedAgent::Guard GuardedAgent::MakeGuard() const {
  Guard guard;
  if (config_.shield) {
    guard.shield.emplace(config_, robot_.model, robot_.scan, robot_.bounds, robot_.step);
  }
  if (config_.tracking) guard.tracker.emplace(robot_.scan, robot_.step);
  if (config_.waypoints) {
    guard.guide = std::make_unique<Guide>(config_, robot_.guide, robot_.scan, robot_.step);
  }
  return guard;
}

void GuardedAgent::Act(const env::ObservationBatch& observations, std::span<float> numbers) {
  const std::span<env::Action> actions = env::AsActions(numbers);
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(observations.batch_size));
  if (guards_.size() != actions.size()) {
    for (const std::uint8_t first : observations.first) SLALOM_CHECK(first != 0);
    guards_.clear();
    for (std::size_t i = 0; i < actions.size(); ++i) guards_.push_back(MakeGuard());
  }
  agent_->Act(config_.waypoints ? Guided(observations) : observations, numbers);
  for (int i = 0; i < observations.batch_size; ++i) {
    if (observations.ended[i] != 0) continue;
    Guard& guard = guards_[i];
    if (observations.first[i] != 0) guard.num_interventions = guard.num_steps = 0;
    env::Action& action = actions[i];
    Twist command = {robot_.bounds.linear_mps(action), robot_.bounds.angular_radps(action)};
    guard.intervened = guard.command.has_value();
    if (guard.intervened) command = *std::exchange(guard.command, std::nullopt);
    if (guard.shield) {
      if (observations.first[i] != 0) guard.shield->Reset();
      const auto ranges_cm = observations.frame(i).ranges_cm;
      std::span<const env::Track> tracks;
      if (guard.tracker) {
        if (observations.first[i] != 0) guard.tracker->Reset();
        guard.tracker->Update(ranges_cm, observations.odometry[i].X_OR);
        tracks = guard.tracker->tracks();
      }
      guard.shield->See(ranges_cm, observations.odometry[i], tracks);
      const Shield::Choice choice = guard.shield->Choose(command);
      guard.intervened = guard.intervened || choice.changed;
      command = choice.command;
    }
    ++guard.num_steps;
    if (!guard.intervened) continue;
    ++guard.num_interventions;
    action = robot_.bounds.Normalise(command.linear, command.angular);
  }
}

/// The observations with the goals that the guides have for the agent. Keeps their commands.
const env::ObservationBatch& GuardedAgent::Guided(const env::ObservationBatch& observations) {
  bool changed = false;
  for (int i = 0; i < observations.batch_size; ++i) {
    if (observations.ended[i] != 0) continue;
    const env::FrameView frame = observations.frame(i);
    const env::Odometry& odometry = observations.odometry[i];
    Guide& guide = *guards_[i].guide;
    if (observations.first[i] != 0) {
      guide.Reset(odometry.X_OR, {frame.state[0], frame.state[1]}, frame.Checksum());
    }
    const Guide::Advice advice = guide.See(frame.ranges_cm, odometry);
    guards_[i].command = advice.command;
    if (!advice.waypoint_R) continue;
    if (!std::exchange(changed, true)) shown_ = observations;
    const std::span<float> state = shown_.mutable_state(i);
    state[0] = static_cast<float>(advice.waypoint_R->x);
    state[1] = static_cast<float>(advice.waypoint_R->y);
  }
  return changed ? shown_ : observations;
}

std::string GuardedAgent::Status(int i) const {
  const std::string own = agent_->Status(i);
  return fmt::format("{}{}guard changed {} of {} actions", own, own.empty() ? "" : "; ",
                     guards_[i].num_interventions, guards_[i].num_steps);
}

}  // namespace slalom::planners
