#include "planners/navigation/navigator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"

namespace slalom::planners {
namespace {

// A plan is cut off before its first point that is nearer to the robot than this, as in
// base_local_planner, [m].
constexpr double kPruneDistance = 1.0;

// How far an enlarged global map reaches beyond the goal, so that detours are on it, [m].
constexpr double kGoalMargin = 5.0;

// move_base's recovery behaviours, in this order.
enum Recovery { kConservativeReset, kRotate, kAggressiveReset, kRotateAgain, kNumRecoveries };

int NumCells(double size, double resolution) {
  return std::max(1, static_cast<int>(std::lround(size / resolution)));
}

ObstacleMapConfig MapConfig(const NavigationConfig& config, const PlannerNavigationConfig& planner,
                            double size, bool rolling) {
  return {.num_cells = NumCells(size, config.resolution),
          .resolution = config.resolution,
          .rolling = rolling,
          .obstacle_range = config.obstacle_range,
          .raytrace_range = config.raytrace_range,
          .inflation_radius = planner.inflation_radius,
          .cost_scaling = planner.cost_scaling,
          .marks_stay = config.marks_stay};
}

}  // namespace

std::string_view ToString(NavigatorState state) {
  switch (state) {
    case NavigatorState::kPlanning:
      return "planning";
    case NavigatorState::kControlling:
      return "controlling";
    case NavigatorState::kRecovering:
      return "recovering";
    case NavigatorState::kAborted:
      return "aborted";
    case NavigatorState::kArrived:
      return "arrived";
  }
  base::CheckFailed(__FILE__, __LINE__, "unknown navigator state");
}

Navigator::Navigator(const NavigationConfig& config, const PlannerNavigationConfig& planner_config,
                     const env::ScanGeometry& geometry, double step,
                     std::unique_ptr<LocalPlanner> planner)
    : config_(config),
      planner_config_(planner_config),
      step_(step),
      footprint_(config.footprint),
      projector_(geometry),
      planner_(std::move(planner)),
      scans_(1 + static_cast<std::size_t>(std::llround(config.scan_age / step))),
      local_map_(MapConfig(config, planner_config, config.local_map_size, true), footprint_),
      on_their_way_(static_cast<std::size_t>(std::ceil(config.command_delay / step - 1e-9))) {
  SLALOM_CHECK(planner_ != nullptr);
  SLALOM_CHECK(step > 0.0);
}

void Navigator::Reset(const base::Pose2& X_OR, base::Vec2 goal_O, std::uint64_t seed) {
  planner_->Reset(seed);
  global_planner_.Reset();
  local_map_.Reset(X_OR.p);
  SizeGlobalMap(goal_O - X_OR.p);
  global_map_->Reset(X_OR.p);
  goal_O_ = goal_O;
  num_steps_ = 0;
  trigger_ = Trigger::kPlanning;
  global_change_ = {};
  path_O_.clear();
  path_begin_ = 0;
  path_is_new_ = false;
  turn_.reset();
  last_sent_time_ = 0.0;
  command_ = {};
  std::ranges::fill(on_their_way_, Twist{});
  record_ = {};
  SendGoal();
}

Twist Navigator::Step(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR,
                      Twist velocity) {
  // Threads that wait for no other see each other's work of the cycle before. If a step holds
  // several cycles, that work is no older than a fraction of the step.
  const bool maps_are_late = step_ * config_.local_map_rate < 1.5;
  projector_.Project(ranges_cm, X_OR, NewestScan());
  if (!maps_are_late) UpdateMaps(X_OR);
  if (Due(planner_config_.control_rate)) {
    const Motion motion = AfterDelay({X_OR, velocity});
    Act(motion.X_OR, motion.velocity);
  }
  if (!on_their_way_.empty()) {
    std::shift_left(on_their_way_.begin(), on_their_way_.end(), 1);
    on_their_way_.back() = command_;
  }
  if (maps_are_late) UpdateMaps(X_OR);
  if (Due(config_.planner_rate)) MakePlan(X_OR);
  ++num_steps_;
  return command_;
}

void Navigator::Look(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR) {
  env::ScanRays& scan = NewestScan();
  projector_.Project(ranges_cm, X_OR, scan);
  local_map_.Mark(scan, X_OR);
  global_map_->Mark(scan, X_OR);
  ++num_steps_;
}

/// `motion` as it will be when the robot acts on a command of now.
Navigator::Motion Navigator::AfterDelay(Motion motion) const {
  // The robot has acted on a part of the oldest command already.
  double time = config_.command_delay - (static_cast<double>(on_their_way_.size()) - 1.0) * step_;
  for (const Twist& command : on_their_way_) {
    const double turn = 0.5 * time * command.angular;
    const auto [s, c] = base::SinCos(motion.X_OR.yaw + turn);
    motion.X_OR.p = motion.X_OR.p + time * command.linear * base::Vec2{c, s};
    motion.X_OR.yaw = base::WrapAngle(motion.X_OR.yaw + 2.0 * turn);
    motion.velocity = command;
    time = step_;
  }
  return motion;
}

env::ScanRays& Navigator::NewestScan() {
  return scans_[static_cast<std::size_t>(num_steps_) % scans_.size()];
}

void Navigator::UpdateMaps(const base::Pose2& X_OR) {
  const auto age = static_cast<std::int64_t>(scans_.size()) - 1;
  if (num_steps_ < age) return;  // No scan is old enough.
  const env::ScanRays& scan = scans_[static_cast<std::size_t>(num_steps_ - age) % scans_.size()];
  if (Due(config_.local_map_rate)) local_map_.Update(scan, X_OR);
  if (Due(config_.global_map_rate)) {
    global_change_ = Union(global_change_, global_map_->Update(scan, X_OR));
  }
}

bool Navigator::Due(double rate) const {
  const auto every = std::max<std::int64_t>(1, std::llround(1.0 / (rate * step_)));
  return num_steps_ % every == 0;
}

// `way`: from the map's centre to the goal, which must be well on the map.
void Navigator::SizeGlobalMap(base::Vec2 way) {
  const double reach = std::max(std::fabs(way.x), std::fabs(way.y)) + kGoalMargin;
  const ObstacleMapConfig config =
      MapConfig(config_, planner_config_, std::max(config_.global_map_size, 2.0 * reach), false);
  if (global_map_ && global_map_->costmap().size_x() == config.num_cells) return;
  global_map_.emplace(config, footprint_);
}

void Navigator::SendGoal() {
  state_ = NavigatorState::kPlanning;
  recovery_index_ = 0;
  last_plan_time_ = last_command_time_ = now();
}

void Navigator::Act(const base::Pose2& X_OR, Twist velocity) {
  if (config_.goal_resend_rate > 0.0 && num_steps_ > 0 && Due(config_.goal_resend_rate) && !turn_ &&
      state_ != NavigatorState::kArrived) {
    SendGoal();
  }
  switch (state_) {
    case NavigatorState::kPlanning:
      // Nothing is sent; the drive goes on until it misses commands.
      if (now() - last_sent_time_ > config_.command_timeout) command_ = {};
      break;
    case NavigatorState::kControlling:
      Control(X_OR, velocity);
      break;
    case NavigatorState::kRecovering:
      Recover(X_OR);
      break;
    case NavigatorState::kAborted:
    case NavigatorState::kArrived:
      command_ = {};
      break;
  }
  ++record_.num_cycles;
  record_.num_backwards += command_.linear < 0.0 ? 1 : 0;
  record_.num_turns_in_place += command_.linear == 0.0 && command_.angular != 0.0 ? 1 : 0;
  record_.last_command = command_;
}

void Navigator::Control(const base::Pose2& X_OR, Twist velocity) {
  if (base::Norm(goal_O_ - X_OR.p) <= planner_config_.goal_tolerance) {
    state_ = NavigatorState::kArrived;
    command_ = {};
    return;
  }
  Prune(X_OR.p);
  const LocalView view{.X_OR = X_OR,
                       .velocity = velocity,
                       .costmap = local_map_.costmap(),
                       .path_O = path(),
                       .path_is_new = path_is_new_,
                       .goal_O = goal_O_};
  const std::optional<Twist> command = planner_->ComputeCommand(view);
  path_is_new_ = false;
  command_ = command.value_or(Twist{});
  last_sent_time_ = now();
  if (command) {
    last_command_time_ = now();
    if (trigger_ == Trigger::kControlling) recovery_index_ = 0;
    return;
  }
  ++record_.num_failed_commands;
  if (now() - last_command_time_ > config_.controller_patience) {
    state_ = NavigatorState::kRecovering;
    trigger_ = Trigger::kControlling;
  } else {
    state_ = NavigatorState::kPlanning;
    last_plan_time_ = now();
  }
}

void Navigator::Recover(const base::Pose2& X_OR) {
  command_ = {};
  if (!config_.recovery || recovery_index_ >= kNumRecoveries) {
    state_ = NavigatorState::kAborted;
    return;
  }
  if (!turn_) ++record_.num_recoveries;
  const bool clears = recovery_index_ == kConservativeReset || recovery_index_ == kAggressiveReset;
  if (clears) {
    if (config_.recovery_clears) {
      const double side = recovery_index_ == kConservativeReset ? config_.conservative_reset
                                                                : config_.aggressive_reset;
      local_map_.ClearOutside(X_OR.p, side);
      global_change_ = Union(global_change_, global_map_->ClearOutside(X_OR.p, side));
    }
  } else if (config_.recovery_rotates) {
    if (!turn_) turn_.emplace(X_OR.yaw);
    const auto rate = turn_->TurnRate(config_, footprint_, local_map_.costmap(), X_OR);
    if (rate) {
      command_.angular = *rate;
      return;
    }
  }
  FinishRecovery();
}

void Navigator::FinishRecovery() {
  turn_.reset();
  ++recovery_index_;
  state_ = NavigatorState::kPlanning;
  last_plan_time_ = now();
}

void Navigator::MakePlan(const base::Pose2& X_OR) {
  if (state_ != NavigatorState::kPlanning && state_ != NavigatorState::kControlling) return;
  const std::vector<base::Vec2>& plan =
      global_planner_.Plan(global_map_->costmap(), global_change_, X_OR.p, goal_O_);
  global_change_ = {};
  if (!plan.empty()) {
    path_O_ = plan;
    path_begin_ = 0;
    path_is_new_ = true;
    last_plan_time_ = now();
    state_ = NavigatorState::kControlling;
    if (trigger_ == Trigger::kPlanning) recovery_index_ = 0;
    return;
  }
  ++record_.num_failed_plans;
  if (state_ == NavigatorState::kPlanning && now() - last_plan_time_ > config_.planner_patience) {
    state_ = NavigatorState::kRecovering;
    trigger_ = Trigger::kPlanning;
    command_ = {};
  }
}

void Navigator::Prune(base::Vec2 p_O) {
  std::size_t i = path_begin_;
  while (i < path_O_.size() && base::Norm(path_O_[i] - p_O) >= kPruneDistance) ++i;
  if (i < path_O_.size()) path_begin_ = i;
}

std::span<const base::Vec2> Navigator::path() const {
  return std::span(path_O_).subspan(path_begin_);
}

}  // namespace slalom::planners
