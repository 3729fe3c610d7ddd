#include "base/geometry.h"

#include "base/sin_cos_parts.h"

namespace slalom::base {

SinCosResult SinCos(double angle) {
  const double n = std::floor(angle * (2.0 / kPi) + 0.5);
  const double r = WithoutQuarters(angle, n);
  const auto [sin_r, cos_r] = SinCosNearZero(r);
  switch (static_cast<long long>(n) & 3) {
    case 0:
      return {sin_r, cos_r};
    case 1:
      return {cos_r, -sin_r};
    case 2:
      return {-sin_r, -cos_r};
    default:
      return {-cos_r, sin_r};
  }
}

double WrapAngle(double angle) {
  const double wrapped = angle - 2.0 * kPi * std::floor((angle + kPi) / (2.0 * kPi));
  return wrapped >= kPi ? wrapped - 2.0 * kPi : wrapped;
}

}  // namespace slalom::base
