#include "sim/localisation.h"

#include <cmath>

namespace slalom::sim {

void Localisation::Reset(const base::Pose2& X_WR, std::uint64_t seed) {
  random_ = base::Random(seed);
  X_WO_ = X_WR_ = X_WR;
  X_OR_ = {};
}

void Localisation::Advance(const base::Pose2& X_WR, double rolled) {
  if (!drifts()) {
    X_WR_ = X_WR;
    X_OR_ = {base::InverseTransform(X_WO_, X_WR.p), base::WrapAngle(X_WR.yaw - X_WO_.yaw)};
    return;
  }
  const double turned = base::WrapAngle(X_WR.yaw - X_WR_.yaw);
  base::Vec2 moved = base::InverseTransform(X_WR_, X_WR.p);  // In R before the move.
  if (config_.from_wheels) moved = base::Transform({{}, 0.5 * turned}, {rolled, 0.0});
  const double way = base::Norm(moved);
  const double position = config_.position_drift * std::sqrt(way);
  const double heading = std::sqrt(config_.heading_drift * config_.heading_drift * way +
                                   config_.turn_drift * config_.turn_drift * std::abs(turned));
  const base::Vec2 error{position * random_.Normal(), position * random_.Normal()};
  X_OR_ = {base::Transform(X_OR_, moved + error),
           base::WrapAngle(X_OR_.yaw + turned + heading * random_.Normal())};
  X_WR_ = X_WR;
}

base::Vec2 Localisation::InRobotFrame(base::Vec2 p_W) const {
  if (!drifts()) return base::InverseTransform(X_WR_, p_W);
  return base::InverseTransform(X_OR_, base::InverseTransform(X_WO_, p_W));
}

}  // namespace slalom::sim
