#include "planners/elastic_band/elastic_band_planner.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace slalom::planners {
namespace {

/// Share of a bubble's radius that the controller counts on.
constexpr double kUsedRadius = 0.7;

/// `value` with its size within the bounds; positive if it is 0.
double ClampSize(double value, double min_size, double max_size) {
  return std::copysign(std::clamp(std::fabs(value), std::min(min_size, max_size), max_size), value);
}

}  // namespace

ElasticBandPlanner::ElasticBandPlanner(const ElasticBandConfig& config)
    : config_(config), band_(config) {}

void ElasticBandPlanner::Reset(std::uint64_t /*seed*/) {
  band_.Clear();
  end_O_ = {};
}

std::optional<Twist> ElasticBandPlanner::ComputeCommand(const LocalView& view) {
  bool blind = false;
  if (!LayBand(view, blind)) return std::nullopt;
  const BandField field(view.costmap, config_.costmap_weight, blind);
  if (!band_.BeginAt(field, view.X_OR.p) || !band_.Optimise(field)) return std::nullopt;
  return FollowBand(view.X_OR);
}

/// Lays a new band if the path is new, or if it reaches farther because the map has moved.
bool ElasticBandPlanner::LayBand(const LocalView& view, bool& blind) {
  const double reach =
      0.5 * view.costmap.resolution() * std::max(view.costmap.size_x(), view.costmap.size_y());
  path_O_.clear();
  for (const base::Vec2 p_O : view.path_O) {
    const bool near = base::Norm(p_O - view.X_OR.p) < reach;
    if (near) path_O_.push_back(p_O);
    if (!near && !path_O_.empty()) break;
  }
  if (path_O_.size() < 2) return false;
  if (!view.path_is_new && path_O_.back() == end_O_ && !band_.bubbles().empty()) return true;
  end_O_ = path_O_.back();
  if (!band_.SetPath(BandField(view.costmap, config_.costmap_weight, false), path_O_)) {
    blind = true;
    if (!band_.SetPath(BandField(view.costmap, config_.costmap_weight, true), path_O_)) {
      return false;
    }
  }
  // A new band is smoothed once before it is followed. If that fails, it stays as it is.
  std::ignore = band_.Optimise(BandField(view.costmap, config_.costmap_weight, blind));
  return true;
}

Twist ElasticBandPlanner::FollowBand(const base::Pose2& X_OR) const {
  const Bubble& own = band_.bubbles()[0];
  const Bubble& next = band_.bubbles()[1];
  const base::Vec2 next_R = base::InverseTransform(X_OR, next.p_O);
  const double angle = std::atan2(next_R.y, next_R.x);
  const double threshold =
      config_.turn_threshold_scale * std::atan2(kUsedRadius * next.radius, base::Norm(next_R));
  const double turn = config_.turn_gain * angle;
  if (std::fabs(angle) > threshold) {
    return {0.0, ClampSize(turn, config_.min_turn_rate_in_place, config_.max_turn_rate)};
  }
  double speed =
      config_.speed_per_radius * kUsedRadius * own.radius * config_.max_speed * std::cos(angle);
  if (std::fabs(speed) > config_.max_speed || std::fabs(speed) < config_.min_speed) {
    const double size =
        std::fabs(speed) > config_.max_speed ? config_.max_speed : config_.min_speed;
    speed = next_R.x < 0.0 ? -size : size;
  }
  return {speed, ClampSize(turn, config_.min_turn_rate, config_.max_turn_rate)};
}

std::unique_ptr<LocalPlanner> MakePlanner(const ElasticBandConfig& config,
                                          const NavigationConfig&) {
  return std::make_unique<ElasticBandPlanner>(config);
}

}  // namespace slalom::planners
