#include "planners/guard/guide.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace slalom::planners {
namespace {

constexpr double kProgress = 0.3;      // What counts as getting on, [m].
constexpr double kArrived = 0.3;       // What counts as having been at the goal, [m].
constexpr double kTurnRate = 1.5;      // Of a turn on the spot, [rad/s].
constexpr double kTurnedTo = 0.6;      // It ends when the waypoint is that far to the side, [rad].
constexpr double kBackSpeed = 0.3;     // Out of a corner, [m/s].
constexpr double kBackTime = 1.5;      // [s]
constexpr double kPathPatience = 2.0;  // Times `rescue_after`: how long a way may be no shorter.

}  // namespace

Guide::Guide(const GuardConfig& config, const GuidePlanner& planner,
             const env::ScanGeometry& geometry, double step)
    : Guide(config, planner, geometry, step, std::make_unique<RestingPlanner>(planner.make())) {}

Guide::Guide(const GuardConfig& config, const GuidePlanner& planner,
             const env::ScanGeometry& geometry, double step,
             std::unique_ptr<RestingPlanner> resting)
    : config_(config),
      step_(step),
      planner_(resting.get()),
      navigator_(planner.navigation, planner.own, geometry, step, std::move(resting)) {}

int Guide::Steps(double time) const { return static_cast<int>(std::lround(time / step_)); }

void Guide::Progress::Take(double distance) {
  ++num_steps;
  if (distance > best - kProgress) return;
  best = distance;
  num_steps = 0;
}

void Guide::Reset(const base::Pose2& X_OR, base::Vec2 goal_R, std::uint64_t seed) {
  goal_O_ = base::Transform(X_OR, goal_R);
  navigator_.Reset(X_OR, goal_O_, seed);
  guides_ = turns_ = has_arrived_ = false;
  to_goal_ = {base::Norm(goal_R), 0};
  along_path_ = {std::numeric_limits<double>::infinity(), 0};
  num_rescues_ = num_rescue_steps_ = num_back_steps_ = 0;
  places_O_.clear();
}

Guide::Advice Guide::See(std::span<const std::uint16_t> ranges_cm, const env::Odometry& odometry) {
  const base::Pose2& X_OR = odometry.X_OR;
  const double left = base::Norm(goal_O_ - X_OR.p);
  to_goal_.Take(left);
  guides_ = guides_ || to_goal_.num_steps >= Steps(config_.waypoint_after);
  if (!guides_) {
    navigator_.Look(ranges_cm, X_OR);
    return {};
  }
  const bool rescues = num_rescue_steps_ > 0;
  planner_->awake = rescues;
  const Twist command = navigator_.Step(ranges_cm, X_OR, {odometry.linear, odometry.angular});
  has_arrived_ = has_arrived_ || left < kArrived;
  if (has_arrived_ && left < config_.near) {
    num_rescue_steps_ = 0;
    turns_ = false;
    places_O_.clear();
    return {};
  }
  if (rescues) {
    if (num_back_steps_ > 0) {
      --num_back_steps_;
      return {.command = Twist{-kBackSpeed, 0.0}};
    }
    --num_rescue_steps_;
    return {.command = command};
  }
  const Way way = WayFrom(X_OR.p);
  if (IsStuck(X_OR.p, way.length)) {
    num_rescue_steps_ = ++num_rescues_ * Steps(config_.rescue_time);
    turns_ = false;
  }
  if (navigator_.path().empty()) return {};
  const base::Vec2 waypoint_R = base::InverseTransform(X_OR, way.waypoint_O);
  const double side = std::atan2(waypoint_R.y, waypoint_R.x);
  turns_ = std::abs(side) > (turns_ ? kTurnedTo : config_.turn_beyond);
  if (turns_) return {.command = Twist{0.0, std::copysign(kTurnRate, side)}};
  return {.waypoint_R = waypoint_R};
}

Guide::Way Guide::WayFrom(base::Vec2 p_O) const {
  Way way{0.0, goal_O_};
  base::Vec2 last = p_O;
  for (const base::Vec2 next : navigator_.path()) {
    const bool is_nearer = way.length < config_.lookahead;
    way.length += base::Norm(next - last);
    if (is_nearer && way.length >= config_.lookahead) way.waypoint_O = next;
    last = next;
  }
  return way;
}

/// Whether the robot has stayed where it is, or its way has not become shorter, for too long. Then
/// both begin anew.
bool Guide::IsStuck(base::Vec2 p_O, double way) {
  const auto num_places = static_cast<std::size_t>(std::max(Steps(config_.rescue_after), 1));
  if (places_O_.size() > num_places) places_O_.erase(places_O_.begin());
  places_O_.push_back(p_O);
  along_path_.Take(way);
  const bool stands =
      places_O_.size() > num_places && base::Norm(p_O - places_O_.front()) < kProgress;
  const bool strays = along_path_.num_steps >= Steps(kPathPatience * config_.rescue_after);
  if (!stands && !strays) return false;
  num_back_steps_ = stands ? Steps(kBackTime) : 0;
  places_O_.clear();
  along_path_ = {std::numeric_limits<double>::infinity(), 0};
  return true;
}

}  // namespace slalom::planners
