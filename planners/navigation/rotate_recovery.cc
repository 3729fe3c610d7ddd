#include "planners/navigation/rotate_recovery.h"

#include <algorithm>
#include <cmath>

namespace slalom::planners {
namespace {

constexpr double kCheckStep = 0.017;  // Between the outlines that are looked at, [rad].

}  // namespace

std::optional<double> RotateRecovery::TurnRate(const NavigationConfig& config,
                                               const PaddedFootprint& footprint,
                                               const Costmap& costmap, const base::Pose2& X_OR) {
  const double from_start = std::fabs(base::WrapAngle(X_OR.yaw - start_yaw_));
  if (half_done_ && from_start <= config.recovery_yaw_tolerance) return std::nullopt;
  double left = from_start;
  if (!half_done_) {
    const double to_half = base::kPi - from_start;
    left = base::kPi + to_half;
    half_done_ = to_half < config.recovery_yaw_tolerance;
  }
  const int num_checks = static_cast<int>(std::ceil(left / kCheckStep));
  for (int i = 0; i < num_checks; ++i) {
    const base::Pose2 X_OC{X_OR.p, X_OR.yaw + i * kCheckStep};
    if (OutlineCost(costmap, footprint, X_OC) < 0) return std::nullopt;
  }
  return std::clamp(std::sqrt(2.0 * config.recovery_turn_acceleration * left),
                    config.recovery_min_turn_rate, config.recovery_max_turn_rate);
}

}  // namespace slalom::planners
