#include "env/sensing/scan.h"

#include "base/check.h"

namespace slalom::env {

std::vector<base::Vec2> BeamDirections(const ScanGeometry& geometry) {
  SLALOM_CHECK_GE(geometry.num_beams, 2);
  const double step = geometry.field_of_view / (geometry.num_beams - 1);
  std::vector<base::Vec2> directions;
  for (int i = 0; i < geometry.num_beams; ++i) {
    const auto [s, c] = base::SinCos(-0.5 * geometry.field_of_view + i * step);
    directions.push_back({c, s});
  }
  return directions;
}

ScanProjector::ScanProjector(const ScanGeometry& geometry)
    : geometry_(geometry), directions_R_(BeamDirections(geometry)) {}

void ScanProjector::Project(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR,
                            ScanRays& out) const {
  SLALOM_CHECK_EQ(ranges_cm.size(), directions_R_.size());
  const auto [s, c] = base::SinCos(X_OR.yaw);
  out.sensor_O = base::Transform(X_OR, geometry_.p_RS);
  out.rays.resize(ranges_cm.size());
  for (std::size_t i = 0; i < ranges_cm.size(); ++i) {
    const double range = 0.01 * ranges_cm[i];
    const base::Vec2 d = directions_R_[i];
    out.rays[i] = {out.sensor_O + range * base::Vec2{c * d.x - s * d.y, s * d.x + c * d.y},
                   range < geometry_.clip};
  }
}

}  // namespace slalom::env
