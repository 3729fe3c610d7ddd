#include "planners/teb/teb.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/check.h"

namespace slalom::planners {
namespace {

/// Distance between the points of the plan from which a band is made, [m].
constexpr double kPlanSpacing = 0.05;
/// Segments of the plan that give the direction of the local goal.
constexpr int kGoalSegments = 3;
/// Share of the costmap's half width that the horizon may reach.
constexpr double kMapShare = 0.85;
/// Length of a band's start that defines its first direction, [m].
constexpr double kStartLength = 0.4;
/// A band nearer than this to an obstacle point passes through it, [m].
constexpr double kTornDistance = 0.06;
/// After this many infeasible cycles in a row, the horizon is quartered.
constexpr int kManyInfeasible = 9;

std::vector<base::Vec2> PointsOf(const TimedBand& band) {
  std::vector<base::Vec2> points;
  for (const base::Pose2& pose : band.poses) points.push_back(pose.p);
  return points;
}

/// Returns the direction from the first pose to the first one beyond kStartLength, or to the last.
base::Vec2 StartDirection(const TimedBand& band) {
  for (const base::Pose2& pose : band.poses) {
    const base::Vec2 d = pose.p - band.poses.front().p;
    if (base::Norm(d) > kStartLength) return d;
  }
  return band.poses.back().p - band.poses.front().p;
}

/// Returns the speeds that reach the second pose in time.
Twist FirstMotion(const TimedBand& band) {
  const base::Pose2 &a = band.poses[0], &b = band.poses[1];
  const double dt = band.dts[0];
  const auto [s, c] = base::SinCos(a.yaw);
  const base::Vec2 d = b.p - a.p;
  const double sign = c * d.x + s * d.y < 0.0 ? -1.0 : 1.0;
  return {sign * base::Norm(d) / dt, base::WrapAngle(b.yaw - a.yaw) / dt};
}

/// Whether the band leads straight through an obstacle, pushed apart on both of its sides. It would
/// take many cycles to get out of that.
bool IsTorn(const TimedBand& band, std::span<const base::Vec2> obstacles) {
  for (std::size_t i = 0; i + 1 < band.poses.size(); ++i) {
    const base::Vec2 a = band.poses[i].p, ab = band.poses[i + 1].p - a;
    const double squared_length = base::Dot(ab, ab);
    for (const base::Vec2 p : obstacles) {
      const base::Vec2 ap = p - a;
      const double share =
          squared_length > 0.0 ? std::clamp(base::Dot(ap, ab) / squared_length, 0.0, 1.0) : 0.0;
      const base::Vec2 d = ap - share * ab;
      if (base::Dot(d, d) < kTornDistance * kTornDistance) return true;
    }
  }
  return false;
}

/// Returns `points`, with more points wherever two are farther apart than kPlanSpacing.
std::vector<base::Vec2> Densify(std::span<const base::Vec2> points) {
  std::vector<base::Vec2> dense = {points.front()};
  for (std::size_t i = 1; i < points.size(); ++i) {
    const base::Vec2 from = points[i - 1], d = points[i] - from;
    const int num_steps =
        std::max(1, static_cast<int>(std::ceil(base::Norm(d) / kPlanSpacing - 1e-6)));
    for (int k = 1; k <= num_steps; ++k) {
      dense.push_back(from + (static_cast<double>(k) / num_steps) * d);
    }
  }
  return dense;
}

}  // namespace

struct TebPlanner::Cycle {
  const LocalView& view;
  base::Pose2 goal;
  BandSurroundings surroundings;
  std::span<const base::Vec2> groups_O;
  double collision_clearance;  // A pose with no more clearance collides, [m].
};

TebPlanner::TebPlanner(const TebConfig& config)
    : config_(config),
      outline_(config.robot.outline_length, config.robot.outline_width),
      clearance_(std::max(config.obstacle.min_distance,
                          static_cast<double>(outline_.circumscribed_radius())) +
                 0.1),
      optimizer_(config_) {
  Reset(0);
}

void TebPlanner::Reset(std::uint64_t seed) {
  random_ = base::Random(base::DeriveSeed(seed, "teb"));
  candidates_.clear();
  follows_first_ = false;
  since_switch_ = std::numeric_limits<double>::infinity();
  since_infeasible_ = std::numeric_limits<double>::infinity();
  num_infeasible_ = 0;
}

std::optional<Twist> TebPlanner::ComputeCommand(const LocalView& view) {
  const Cycle cycle = Prepare(view);
  MoveBands(cycle);
  ExploreClasses(cycle);
  OptimizeBands(cycle);
  if (candidates_.empty()) return GiveUp();
  ChooseBand();
  DropDetours();
  if (!IsFeasible(cycle, candidates_.front().band)) return GiveUp();
  num_infeasible_ = 0;
  const Twist motion = FirstMotion(candidates_.front().band);
  const TebRobotConfig& robot = config_.robot;
  return Twist{std::clamp(motion.linear, -robot.max_backward, robot.max_linear),
               std::clamp(motion.angular, -robot.max_angular, robot.max_angular)};
}

std::optional<Twist> TebPlanner::GiveUp() {
  candidates_.clear();
  follows_first_ = false;
  since_infeasible_ = 0.0;
  ++num_infeasible_;
  return std::nullopt;
}

TebPlanner::Cycle TebPlanner::Prepare(const LocalView& view) {
  SLALOM_CHECK(!view.path_O.empty());
  since_switch_ += config_.trajectory.control_period;
  since_infeasible_ += config_.trajectory.control_period;
  CutPlan(view);
  FindObstacles(view);
  clearance_.Update(view.costmap, view.X_OR.p);
  const auto [s, c] = base::SinCos(view.X_OR.yaw);
  const float clearance =
      outline_.Clearance(clearance_, 0.0f, 0.0f, static_cast<float>(c), static_cast<float>(s));
  const double reach =
      base::Norm(plan_.points.back() - view.X_OR.p) + config_.homotopy.roadmap_width;
  // No robot passes between cells that are both nearer than its half width to its centre.
  const double gap = 2.0 * static_cast<double>(outline_.inscribed_radius());
  return {view,
          {plan_.points.back(), goal_yaw_},
          {obstacles_O_, via_points_O_, view.velocity},
          groups_.Find(view.costmap, view.X_OR.p, reach, gap),
          std::min(0.0, static_cast<double>(clearance) - 0.01)};
}

void TebPlanner::CutPlan(const LocalView& view) {
  const TebTrajectoryConfig& config = config_.trajectory;
  const double half_map =
      0.5 * view.costmap.resolution() * std::min(view.costmap.size_x(), view.costmap.size_y());
  double length = std::min(config.look_ahead, kMapShare * half_map);
  const bool shrinks = config.shrink_horizon && since_infeasible_ < config.shrink_horizon_duration;
  if (shrinks) length *= num_infeasible_ > kManyInfeasible ? 0.25 : 0.5;
  CutLocalPath(view.path_O, view.X_OR.p, config.look_ahead, length + kGoalSegments * kPlanSpacing,
               kPlanSpacing, plan_);
  std::vector<base::Vec2>& points = plan_.points;
  if (points.size() < 2) points.push_back(view.goal_O);
  const std::size_t num_last = std::min(points.size() - 1, static_cast<std::size_t>(kGoalSegments));
  const base::Vec2 last = points.back() - points[points.size() - 1 - num_last];
  goal_yaw_ = std::atan2(last.y, last.x);
  if (!plan_.ends_at_goal && points.size() > num_last + 1) points.resize(points.size() - num_last);
  points.front() = view.X_OR.p;
  via_points_O_.clear();
  const double separation = config.via_point_separation;
  if (separation > 0.0) {
    const auto step = std::max<std::size_t>(1, static_cast<std::size_t>(separation / kPlanSpacing));
    for (std::size_t i = step; i + 1 < points.size(); i += step) via_points_O_.push_back(points[i]);
  }
}

void TebPlanner::FindObstacles(const LocalView& view) {
  const double reach = config_.trajectory.look_ahead +
                       config_.obstacle.min_distance * config_.obstacle.cutoff_factor;
  const auto [s, c] = base::SinCos(view.X_OR.yaw);
  obstacles_O_.clear();
  const Costmap& costmap = view.costmap;
  const auto costs = costmap.costs();
  for (int y = 0; y < costmap.size_y(); ++y) {
    const std::size_t row = costmap.Index({0, y});
    for (int x = 0; x < costmap.size_x(); ++x) {
      if (costs[row + static_cast<std::size_t>(x)] != kLethalCost) continue;
      const base::Vec2 p_O = costmap.CentreOf({x, y});
      const base::Vec2 d = p_O - view.X_OR.p;
      const double distance = base::Norm(d);
      const bool is_behind = c * d.x + s * d.y < 0.0;
      if (distance > reach || (is_behind && distance > config_.obstacle.behind_robot_distance)) {
        continue;
      }
      obstacles_O_.push_back(p_O);
    }
  }
}

void TebPlanner::MoveBands(const Cycle& cycle) {
  const TebTrajectoryConfig& config = config_.trajectory;
  std::vector<Candidate> moved;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    Candidate& candidate = candidates_[i];
    const base::Pose2& old_goal = candidate.band.poses.back();
    const bool is_near =
        base::Norm(cycle.goal.p - old_goal.p) < config.reinit_distance &&
        std::abs(base::WrapAngle(cycle.goal.yaw - old_goal.yaw)) < config.reinit_angle;
    if (is_near && !IsTorn(candidate.band, obstacles_O_)) {
      MoveEnds(cycle.view.X_OR, cycle.goal, config.min_samples, candidate.band);
      candidate.homotopy = ClassOf(PointsOf(candidate.band), cycle.groups_O);
      candidate.is_plans = false;
      const bool is_known = std::any_of(moved.begin(), moved.end(), [&](const Candidate& other) {
        return SameClass(other.homotopy, candidate.homotopy);
      });
      if (!is_known) {
        moved.push_back(std::move(candidate));
        continue;
      }
    }
    if (i == 0) follows_first_ = false;
  }
  candidates_ = std::move(moved);
}

void TebPlanner::ExploreClasses(const Cycle& cycle) {
  AddIfNew(cycle, plan_.points, true);
  const TebHomotopyConfig& config = config_.homotopy;
  const auto is_full = [&] { return static_cast<int>(candidates_.size()) >= config.max_classes; };
  if (!config.enabled || is_full()) return;
  const base::Vec2 p_OL = cycle.view.X_OR.p;
  SearchRoadmap({config.roadmap_samples, config.roadmap_width, config.heading_threshold,
                 config_.obstacle.min_distance, config.max_roadmap_paths},
                {0.0, 0.0}, cycle.goal.p - p_OL, clearance_, random_,
                [&](std::span<const base::Vec2> way_L) {
                  std::vector<base::Vec2> way_O;
                  for (const base::Vec2 p_L : way_L) way_O.push_back(p_OL + p_L);
                  AddIfNew(cycle, way_O, false);
                  return !is_full();
                });
}

void TebPlanner::AddIfNew(const Cycle& cycle, std::span<const base::Vec2> points, bool is_plans) {
  HomotopyClass homotopy = ClassOf(points, cycle.groups_O);
  for (Candidate& candidate : candidates_) {
    if (!SameClass(candidate.homotopy, homotopy)) continue;
    candidate.is_plans |= is_plans;
    return;
  }
  // The plan is never left out for lack of room.
  if (is_plans && !config_.homotopy.enabled) candidates_.clear();
  const std::vector<base::Vec2> dense = Densify(points);
  candidates_.push_back(
      {MakeBand(dense, cycle.view.X_OR.yaw, cycle.goal.yaw, config_.robot.max_linear,
                config_.robot.max_angular, config_.trajectory.min_samples),
       std::move(homotopy), 0.0, is_plans});
}

void TebPlanner::OptimizeBands(const Cycle& cycle) {
  std::vector<Candidate> optimized;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    Candidate& candidate = candidates_[i];
    if (!optimizer_.Optimize(cycle.surroundings, candidate.band)) {
      if (i == 0) follows_first_ = false;
      continue;
    }
    const BandCost cost = optimizer_.Cost(cycle.surroundings, candidate.band);
    candidate.cost = config_.homotopy.obstacle_cost_scale * cost.obstacles + cost.rest;
    optimized.push_back(std::move(candidate));
  }
  candidates_ = std::move(optimized);
}

void TebPlanner::ChooseBand() {
  const TebHomotopyConfig& config = config_.homotopy;
  const auto cost_of = [&](std::size_t i) {
    const Candidate& candidate = candidates_[i];
    return candidate.cost * (i == 0 && follows_first_ ? config.cost_hysteresis : 1.0) *
           (candidate.is_plans ? config.prefer_initial_plan : 1.0);
  };
  std::size_t best = 0;
  for (std::size_t i = 1; i < candidates_.size(); ++i) {
    if (cost_of(i) < cost_of(best)) best = i;
  }
  if (best != 0 && follows_first_ && since_switch_ < config.switching_blocking_period) best = 0;
  if (best != 0) {
    since_switch_ = 0.0;
    std::swap(candidates_[0], candidates_[best]);
  }
  follows_first_ = true;
}

void TebPlanner::DropDetours() {
  const TebHomotopyConfig& config = config_.homotopy;
  const TimedBand& best = candidates_.front().band;
  const base::Vec2 direction = StartDirection(best);
  const double duration = best.Duration();
  const auto is_detour = [&](const Candidate& candidate) {
    const base::Vec2 other = StartDirection(candidate.band);
    const double angle = std::atan2(base::Cross(direction, other), base::Dot(direction, other));
    return std::abs(angle) > config.detour_angle ||
           candidate.band.Duration() > config.max_detour_ratio * duration;
  };
  candidates_.erase(std::remove_if(candidates_.begin() + 1, candidates_.end(), is_detour),
                    candidates_.end());
}

bool TebPlanner::IsFeasible(const Cycle& cycle, const TimedBand& band) const {
  const int last =
      std::min(config_.trajectory.feasibility_check_poses, static_cast<int>(band.poses.size()) - 1);
  const auto step = static_cast<double>(outline_.inscribed_radius());
  for (int i = 0; i < last; ++i) {
    const base::Pose2 &a = band.poses[i], &b = band.poses[i + 1];
    const base::Vec2 d = b.p - a.p;
    const double turn = base::WrapAngle(b.yaw - a.yaw);
    const int num_checks = std::max(1, static_cast<int>(std::ceil(base::Norm(d) / step)));
    for (int k = 1; k <= num_checks; ++k) {
      const double share = static_cast<double>(k) / num_checks;
      const base::Vec2 p_L = a.p + share * d - cycle.view.X_OR.p;
      const auto [s, c] = base::SinCos(a.yaw + share * turn);
      const float clearance =
          outline_.Clearance(clearance_, static_cast<float>(p_L.x), static_cast<float>(p_L.y),
                             static_cast<float>(c), static_cast<float>(s));
      if (clearance <= cycle.collision_clearance) return false;
    }
  }
  return true;
}

std::vector<TimedBand> TebPlanner::bands() const {
  std::vector<TimedBand> bands;
  for (const Candidate& candidate : candidates_) bands.push_back(candidate.band);
  return bands;
}

std::unique_ptr<LocalPlanner> MakePlanner(const TebConfig& config, const NavigationConfig&) {
  return std::make_unique<TebPlanner>(config);
}

}  // namespace slalom::planners
