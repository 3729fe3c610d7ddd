#include "planners/dwa/dwa.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace slalom::planners {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();
constexpr int kGlanceStep = 8;  // Between the poses that are looked at first.

}  // namespace

DwaPlanner::DwaPlanner(const DwaConfig& config, const FootprintConfig& footprint)
    : config_(config), footprint_(footprint) {}

void DwaPlanner::Reset(std::uint64_t /*seed*/) {
  turned_left_ = turned_right_ = no_left_ = no_right_ = false;
  last_turn_O_ = {};
  escaping_ = false;
  X_OE_ = {};
}

std::optional<Twist> DwaPlanner::ComputeCommand(const LocalView& view) {
  if (!MeasureDistances(view)) return std::nullopt;
  const Window window = DynamicWindow(view);
  Trajectory best;
  if (!escaping_) best = BestAhead(view, window);
  best = BestOnTheSpot(view, window, best);
  if (best.admissible()) {
    NoteTurn(view, best);
  } else {
    best = BackUp(view);
  }
  ForgetTurns(view);
  EndEscape(view);
  if (!best.admissible()) return std::nullopt;
  return best.command;
}

bool DwaPlanner::MeasureDistances(const LocalView& view) {
  const Costmap& map = view.costmap;
  const double reach = 0.5 * map.resolution() * std::max(map.size_x(), map.size_y());
  path_cells_.clear();
  local_end_O_ = view.X_OR.p;
  const auto add = [&](base::Vec2 p_O) {
    const CellIndex c = map.CellAt(p_O);
    if (!map.Contains(c)) return false;
    if (path_cells_.empty() || !(path_cells_.back() == c)) path_cells_.push_back(c);
    return true;
  };
  // The part within reach and one point more, as `transformGlobalPlan` takes it. The path may come
  // from farther away.
  bool near = false;
  for (std::size_t i = 0; i < view.path_O.size(); ++i) {
    const base::Vec2 p_O = view.path_O[i];
    const bool was_near = near;
    near = base::Norm(p_O - view.X_OR.p) <= reach;
    if (!near && !was_near) {
      if (path_cells_.empty()) continue;
      break;
    }
    local_end_O_ = p_O;
    // If points are farther apart than a cell, the cells between them are on the path too.
    if (!path_cells_.empty()) {
      const base::Vec2 before_O = view.path_O[i - 1];
      const int steps = static_cast<int>(std::ceil(base::Norm(p_O - before_O) / map.resolution()));
      for (int j = 1; j < steps; ++j) {
        add(before_O + (static_cast<double>(j) / steps) * (p_O - before_O));
      }
    }
    if (!add(p_O) && !path_cells_.empty()) break;
  }
  if (path_cells_.empty()) return false;
  CoveredCells(map, footprint_, view.X_OR, under_robot_);
  to_path_.Start(map, under_robot_, path_cells_);
  to_goal_.Start(map, {}, std::span(path_cells_).last(1));
  return true;
}

DwaPlanner::Window DwaPlanner::DynamicWindow(const LocalView& view) const {
  const double period = 1.0 / config_.navigation.control_rate;
  const double v = view.velocity.linear, w = view.velocity.angular;
  const double dv = config_.acceleration * period, dw = config_.turn_acceleration * period;
  // The robot must not drive beyond the end of the path within the simulated time.
  const double max_speed =
      std::min(config_.max_speed, base::Norm(local_end_O_ - view.X_OR.p) / config_.sim_time);
  return {.min = {std::max(config_.min_speed, v - dv), std::max(-config_.max_turn_rate, w - dw)},
          .max = {std::max(std::min(max_speed, v + dv), config_.min_speed),
                  std::min(config_.max_turn_rate, w + dw)}};
}

DwaPlanner::Trajectory DwaPlanner::BestAhead(const LocalView& view, const Window& window) {
  const double speed_step = (window.max.linear - window.min.linear) / (config_.speed_samples - 1);
  const double turn_step = (window.max.angular - window.min.angular) / (config_.turn_samples - 1);
  commands_.clear();
  for (int i = 0; i < config_.speed_samples; ++i) {
    const double speed = window.min.linear + i * speed_step;
    commands_.push_back({speed, 0.0});
    // The last turn rate is left out, as in ROS.
    for (int j = 0; j < config_.turn_samples - 1; ++j) {
      commands_.push_back({speed, window.min.angular + j * turn_step});
    }
  }
  rollouts_.Simulate(config_, view.X_OR, view.velocity, commands_);
  candidates_.clear();
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    const base::Pose2 end = rollouts_.pose(i, rollouts_.num_poses(i) - 1).X_OR;
    const auto cost = DistanceCost(view.costmap, end.p);
    if (cost) candidates_.push_back({*cost, i});
  }
  // The first sample of least cost wins. Outlines are expensive: samples are checked in the order
  // of their other costs, and only while they can still win.
  std::sort(candidates_.begin(), candidates_.end());
  Trajectory best;
  std::size_t best_index = commands_.size();
  double limit = kNoLimit;
  for (const auto& [least_cost, i] : candidates_) {
    if (least_cost > limit) break;
    if (!MayCost(view, i, limit)) continue;
    const Trajectory trajectory = ScoreRollout(view, i, limit);
    if (!trajectory.admissible()) continue;
    if (trajectory.cost < limit || i < best_index) {
      best = trajectory;
      best_index = i;
      limit = best.cost;
    }
  }
  return best;
}

DwaPlanner::Trajectory DwaPlanner::BestOnTheSpot(const LocalView& view, const Window& window,
                                                 const Trajectory& ahead) {
  Trajectory best = ahead;
  const double turn_step = (window.max.angular - window.min.angular) / (config_.turn_samples - 1);
  const auto least_cost = DistanceCost(view.costmap, view.X_OR.p);
  if (!least_cost) return best;
  commands_.clear();
  for (int i = 0; i < config_.turn_samples; ++i) {
    const double sample = window.min.angular + i * turn_step;
    if (std::fabs(sample) <= turn_step) continue;  // Too slow to count as a turn.
    if ((sample > 0.0 && no_left_) || (sample < 0.0 && no_right_)) continue;
    const double rate = sample > 0.0 ? std::max(sample, config_.min_turn_rate_in_place)
                                     : std::min(sample, -config_.min_turn_rate_in_place);
    commands_.push_back({0.0, rate});
  }
  double limit = best.admissible() ? best.cost : kNoLimit;
  if (*least_cost > limit) return best;
  rollouts_.Simulate(config_, view.X_OR, view.velocity, commands_);
  int nearest = std::numeric_limits<int>::max();  // To the goal, a look ahead after the turn.
  for (std::size_t i = 0; i < commands_.size() && *least_cost <= limit; ++i) {
    if (!MayCost(view, i, limit)) continue;
    const Trajectory trajectory = ScoreRollout(view, i, limit);
    if (!trajectory.admissible()) continue;
    const CellIndex ahead_cell =
        view.costmap.CellAt(base::Transform(trajectory.end, {config_.heading_lookahead, 0.0}));
    if (!view.costmap.Contains(ahead_cell)) continue;
    const int distance = to_goal_.Distance(ahead_cell);
    if (distance >= nearest) continue;
    nearest = distance;
    best = trajectory;
    limit = best.cost;
  }
  return best;
}

DwaPlanner::Trajectory DwaPlanner::BackUp(const LocalView& view) {
  Trajectory back = Score(view, {config_.escape_speed, 0.0});
  if (!escaping_ && back.cost > Trajectory::kNoWay) {
    escaping_ = true;
    X_OE_ = view.X_OR;
  }
  if (back.cost == Trajectory::kHits) back.cost = 1.0;  // Whatever is behind the robot.
  return back;
}

DwaPlanner::Trajectory DwaPlanner::Score(const LocalView& view, Twist command) {
  commands_.assign(1, command);
  rollouts_.Simulate(config_, view.X_OR, view.velocity, commands_);
  return ScoreRollout(view, 0, kNoLimit);
}

/// Whether a rollout may be admissible and cost `limit` at most, by a few of its poses, the last
/// first: most of those that hit something do so far ahead.
bool DwaPlanner::MayCost(const LocalView& view, std::size_t i, double limit) {
  const auto distance_cost =
      DistanceCost(view.costmap, rollouts_.pose(i, rollouts_.num_poses(i) - 1).X_OR.p);
  if (!distance_cost) return false;
  for (int k = rollouts_.num_poses(i) - 1; k >= 0; k -= kGlanceStep) {
    const auto [X_OR, heading] = rollouts_.pose(i, k);
    const int outline = OutlineCost(view.costmap, footprint_, X_OR.p, heading);
    if (outline < 0) return false;
    if (*distance_cost + config_.obstacle_cost_scale * outline > limit) return false;
  }
  return true;
}

/// Scores a rollout. If it costs more than `limit`, it may count as one that hits something.
DwaPlanner::Trajectory DwaPlanner::ScoreRollout(const LocalView& view, std::size_t i,
                                                double limit) {
  const int num_poses = rollouts_.num_poses(i);
  Trajectory trajectory{.command = commands_[i], .end = rollouts_.pose(i, num_poses - 1).X_OR};
  const double distance_cost = DistanceCost(view.costmap, trajectory.end.p).value_or(0.0);
  double cost = distance_cost;
  int highest = 0;
  for (int k = 0; k < num_poses && cost <= limit; ++k) {
    const auto [X_OR, heading] = rollouts_.pose(i, k);
    const int outline = OutlineCost(view.costmap, footprint_, X_OR.p, heading);
    if (outline < 0) return trajectory;
    if (!DistanceCost(view.costmap, X_OR.p)) {
      trajectory.cost = Trajectory::kNoWay;
      return trajectory;
    }
    highest = std::max<int>({highest, outline, view.costmap.cost(view.costmap.CellAt(X_OR.p))});
    cost = distance_cost + config_.obstacle_cost_scale * highest;
  }
  if (cost <= limit) trajectory.cost = cost;
  return trajectory;
}

std::optional<double> DwaPlanner::DistanceCost(const Costmap& costmap, base::Vec2 p_O) {
  const CellIndex c = costmap.CellAt(p_O);
  if (!costmap.Contains(c)) return std::nullopt;
  const std::uint16_t path = to_path_.Distance(c), goal = to_goal_.Distance(c);
  if (path == DistanceGrid::kNoWay || goal == DistanceGrid::kNoWay) return std::nullopt;
  const double scale = config_.meter_scoring ? costmap.resolution() : 1.0;
  return scale * (config_.path_distance_scale * path + config_.goal_distance_scale * goal);
}

void DwaPlanner::NoteTurn(const LocalView& view, const Trajectory& best) {
  if (best.command.linear > 0.0) return;
  if (best.command.angular > 0.0) {
    if (turned_left_) no_right_ = true;
    turned_left_ = true;
  } else if (best.command.angular < 0.0) {
    if (turned_right_) no_left_ = true;
    turned_right_ = true;
  }
  last_turn_O_ = view.X_OR.p;
}

void DwaPlanner::ForgetTurns(const LocalView& view) {
  if (base::Norm(view.X_OR.p - last_turn_O_) <= config_.oscillation_reset_distance) return;
  turned_left_ = turned_right_ = no_left_ = no_right_ = false;
}

void DwaPlanner::EndEscape(const LocalView& view) {
  if (base::Norm(view.X_OR.p - X_OE_.p) > config_.escape_reset_distance ||
      std::fabs(base::WrapAngle(view.X_OR.yaw - X_OE_.yaw)) > config_.escape_reset_angle) {
    escaping_ = false;
  }
}

std::unique_ptr<LocalPlanner> MakePlanner(const DwaConfig& config,
                                          const NavigationConfig& navigation) {
  return std::make_unique<DwaPlanner>(config, navigation.footprint);
}

}  // namespace slalom::planners
