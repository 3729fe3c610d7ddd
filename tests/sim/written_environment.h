#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "env/environment.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"
#include "tests/support/moving_courses.h"

/// The task written down plainly and slowly, in double precision and with the C library's
/// functions: what a step of `CourseEnvironments` must give, from what anybody can see, which is
/// the config, the course, the action, and the pose and the motion time before and after. Only the
/// motion of an obstacle is `sim::Motion`'s, which has an oracle of its own.
///
/// Frames: `W` the course's own frame, `R` the robot, `O` the robot at the start.

namespace slalom::sim {

inline constexpr double kNoHit = std::numeric_limits<double>::infinity();

/// Distance along a beam to the nearest obstacle, each grown by `grow` [m]: every shape is tried.
inline double CastOne(const Course& course, base::Vec2 from, base::Vec2 along, double grow) {
  using base::Vec2;
  double nearest = kNoHit;
  for (const Circle& circle : course.circles) {
    const Vec2 d = circle.p_W - from;
    const double b = base::Dot(d, along);
    const double radius = circle.radius + grow;
    const double discriminant = b * b - base::Dot(d, d) + radius * radius;
    if (discriminant < 0.0) continue;
    const double root = std::sqrt(discriminant);
    if (b + root < 0.0) continue;
    nearest = std::min(nearest, std::max(0.0, b - root));
  }
  for (const Box& box : course.boxes) {
    const Vec2 p_B = base::InverseTransform(box.X_WB, from);
    const Vec2 half{box.half_size.x + grow, box.half_size.y + grow};
    if (std::abs(p_B.x) < half.x && std::abs(p_B.y) < half.y) nearest = 0.0;
    const Vec2 corners_B[] = {
        {-half.x, -half.y}, {half.x, -half.y}, {half.x, half.y}, {-half.x, half.y}};
    for (int k = 0; k < 4; ++k) {
      const Vec2 a = base::Transform(box.X_WB, corners_B[k]);
      const Vec2 edge = base::Transform(box.X_WB, corners_B[(k + 1) % 4]) - a;
      const double turn = base::Cross(along, edge);
      if (turn == 0.0) continue;
      const double range = base::Cross(a - from, edge) / turn;
      const double place = base::Cross(a - from, along) / turn;
      if (range >= 0.0 && place >= 0.0 && place <= 1.0) nearest = std::min(nearest, range);
    }
  }
  return nearest;
}

/// Coordinates below 16 m and a beam's direction are rounded to single precision, 2^-24 relative:
/// together below 16 m * 2^-24 * 8 operations = 8e-6 m sideways. A grazing beam may then see the
/// obstacle or not, so the truth is bracketed by slightly larger and slightly smaller obstacles.
inline constexpr double kSideways = 1e-5;
inline constexpr double kAlong = 1e-4;

/// Where a number must lie. Both ends may be it.
struct Bracket {
  double low = 0.0, high = 0.0;
};

/// Whether a rectangle of half sizes `half` at `X_WR`, grown by `grow` [m], overlaps an obstacle.
inline bool Overlaps(const Course& course, base::Vec2 half, const base::Pose2& X_WR, double grow) {
  using base::Vec2;
  half = half + Vec2{grow, grow};
  for (const Circle& circle : course.circles) {
    const Vec2 p_R = base::InverseTransform(X_WR, circle.p_W);
    const double dx = std::max(0.0, std::abs(p_R.x) - half.x);
    const double dy = std::max(0.0, std::abs(p_R.y) - half.y);
    if (std::hypot(dx, dy) < circle.radius) return true;
  }
  for (const Box& box : course.boxes) {
    // Two rectangles are apart if and only if they are along a side of one of them.
    const Vec2 d = box.X_WB.p - X_WR.p;
    const Vec2 sides[] = {{std::cos(X_WR.yaw), std::sin(X_WR.yaw)},
                          {-std::sin(X_WR.yaw), std::cos(X_WR.yaw)},
                          {std::cos(box.X_WB.yaw), std::sin(box.X_WB.yaw)},
                          {-std::sin(box.X_WB.yaw), std::cos(box.X_WB.yaw)}};
    bool apart = false;
    for (const Vec2 side : sides) {
      const double reach = half.x * std::abs(base::Dot(side, sides[0])) +
                           half.y * std::abs(base::Dot(side, sides[1])) +
                           box.half_size.x * std::abs(base::Dot(side, sides[2])) +
                           box.half_size.y * std::abs(base::Dot(side, sides[3]));
      apart = apart || std::abs(base::Dot(side, d)) >= reach;
    }
    if (!apart) return true;
  }
  return false;
}

/// Reward, outcome and frames of one episode.
class WrittenEpisode {
 public:
  /// Begins at rest at `X_WR`. `course` must outlive this.
  WrittenEpisode(const EnvironmentConfig& config, const Course& course, const base::Pose2& X_WR,
                 double motion_time)
      : config_(config),
        course_(course),
        X_WO_(X_WR),
        X_WR_(X_WR),
        motion_start_(motion_time),
        // At rest: the action that commands 0 m/s.
        linear_(-2.0 * config.action.linear_min /
                    (config.action.linear_max - config.action.linear_min) -
                1.0) {}

  double motion_time() const { return motion_start_ + num_steps_ * config_.episode.step; }

  /// Whether the robot overlaps an obstacle where it is now: 0 or 1 for sure, or from 0 to 1.
  Bracket Touches() const {
    const Course frozen = test::Frozen(course_, motion_time());
    const base::Vec2 half{0.5 * config_.robot.length, 0.5 * config_.robot.width};
    return {Overlaps(frozen, half, X_WR_, -kSideways) ? 1.0 : 0.0,
            Overlaps(frozen, half, X_WR_, kSideways) ? 1.0 : 0.0};
  }

  /// Where a drive without inertia and slip, which one rigid-body step carries on, is after an
  /// action, if nothing is in its way.
  base::Pose2 AfterIdealStep(const env::Action& action) const {
    const env::ActionBounds& bounds = config_.action;
    const double a = Clipped(action.linear), w = Clipped(action.angular);
    const double half_way = 0.5 * (bounds.linear_max - bounds.linear_min);
    const double way = (bounds.linear_min + half_way + a * half_way) * config_.episode.step;
    const double turn = w * bounds.angular_max * config_.episode.step;
    const double along = X_WR_.yaw + 0.5 * turn;
    return {X_WR_.p + way * base::Vec2{std::cos(along), std::sin(along)}, X_WR_.yaw + turn};
  }

  /// A step that ended at `X_WR`, in which the robot touched something or not.
  env::StepResult Step(const env::Action& action, const base::Pose2& X_WR, bool touched) {
    const double before = GoalDistance();
    X_WR_ = X_WR;
    linear_ = Clipped(action.linear);
    angular_ = Clipped(action.angular);
    ++num_steps_;
    double reward = config_.reward.progress * (before - GoalDistance()) - config_.reward.slack;
    if (touched) reward -= config_.reward.collision;
    env::Outcome outcome = env::Outcome::kRunning;
    if (touched && config_.episode.collision_ends) {
      outcome = env::Outcome::kCollision;
    } else if (IsLookedAt() && HasArrived()) {
      outcome = env::Outcome::kSuccess;
      reward += config_.reward.success;
    } else if (num_steps_ == config_.episode.max_steps) {
      outcome = env::Outcome::kTimeout;
      reward -= config_.reward.timeout;
    }
    return {static_cast<float>(reward), touched ? 1.0f : 0.0f, outcome};
  }

  base::Vec2 goal_R() const { return Seen(X_WR_, course_.goal_W); }
  double last_linear() const { return linear_; }
  double last_angular() const { return angular_; }
  base::Pose2 X_OR() const { return {Seen(X_WO_, X_WR_.p), X_WR_.yaw - X_WO_.yaw}; }

  /// The distance that each beam goes before noise, [m].
  std::vector<Bracket> Ranges() const {
    const LidarConfig& lidar = config_.lidar;
    const Course frozen = test::Frozen(course_, motion_time());
    const double c = std::cos(X_WR_.yaw), s = std::sin(X_WR_.yaw);
    const base::Vec2 from = X_WR_.p + base::Vec2{c * lidar.offset_x - s * lidar.offset_y,
                                                 s * lidar.offset_x + c * lidar.offset_y};
    std::vector<Bracket> ranges;
    for (int beam = 0; beam < lidar.num_beams; ++beam) {
      const double share = static_cast<double>(beam) / (lidar.num_beams - 1);
      const double angle = X_WR_.yaw + lidar.field_of_view * (share - 0.5);
      const auto cast = [&](double grow) {
        return std::min(lidar.max_range,
                        CastOne(frozen, from, {std::cos(angle), std::sin(angle)}, grow));
      };
      ranges.push_back({std::max(0.0, cast(kSideways) - kAlong), cast(-kSideways) + kAlong});
    }
    return ranges;
  }

  /// What the sensor makes of a distance, [cm]: raised to its least, rounded, clipped.
  int Reported(double range) const {
    const LidarConfig& lidar = config_.lidar;
    const double clip = std::min(config_.observation.range_clip, lidar.max_range);
    const double limited = std::clamp(range, lidar.min_range, clip);
    const double steps = std::floor(limited / lidar.resolution + 0.5);
    return static_cast<int>(std::floor(steps * lidar.resolution * 100.0 + 0.5));
  }

 private:
  static double Clipped(float part) { return std::min(1.0, std::max(-1.0, double{part})); }

  static base::Vec2 Seen(const base::Pose2& X_WR, base::Vec2 p_W) {
    const double dx = p_W.x - X_WR.p.x, dy = p_W.y - X_WR.p.y;
    const double c = std::cos(X_WR.yaw), s = std::sin(X_WR.yaw);
    return {c * dx + s * dy, c * dy - s * dx};
  }

  double GoalDistance() const {
    return std::hypot(course_.goal_W.x - X_WR_.p.x, course_.goal_W.y - X_WR_.p.y);
  }

  bool HasArrived() const {
    if (GoalDistance() < config_.episode.goal_tolerance) return true;
    return config_.episode.finish_ahead > 0.0 &&
           Seen(course_.start, X_WR_.p).x >= config_.episode.finish_ahead;
  }

  /// Whether one of the times period, 2 period, ... lies in this step, its end included. In whole
  /// milliseconds. Requires: step and period are.
  bool IsLookedAt() const {
    const long step = std::lround(1000.0 * config_.episode.step);
    const long period = std::lround(1000.0 * config_.episode.look_period);
    if (period == 0) return true;
    for (long time = period; time <= num_steps_ * step; time += period) {
      if (time > (num_steps_ - 1) * step) return true;
    }
    return false;
  }

  const EnvironmentConfig config_;
  const Course& course_;
  const base::Pose2 X_WO_;
  base::Pose2 X_WR_;
  const double motion_start_;
  int num_steps_ = 0;
  double linear_, angular_ = 0.0;
};

}  // namespace slalom::sim
