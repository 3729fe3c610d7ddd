#include "base/geometry.h"

namespace slalom::base {

SinCosResult SinCos(double angle) {
  // Cody-Waite: angle - n*pi/2 in three parts, then Taylor polynomials on [-pi/4, pi/4], whose
  // truncation there is below 1e-16.
  constexpr double kPio2High = 1.57079632673412561417e+00;
  constexpr double kPio2Mid = 6.07710050630396597660e-11;
  constexpr double kPio2Low = 2.02226624879595063154e-21;
  const double n = std::floor(angle * (2.0 / kPi) + 0.5);
  const double r = ((angle - n * kPio2High) - n * kPio2Mid) - n * kPio2Low;
  const double z = r * r;
  const double sin_r =
      r + r * z *
              (-1.0 / 6 +
               z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 +
                                                        z * (-1.0 / 39916800 +
                                                             z * (1.0 / 6227020800.0 -
                                                                  z * (1.0 / 1307674368000.0)))))));
  const double cos_r =
      1.0 +
      z * (-0.5 + z * (1.0 / 24 +
                       z * (-1.0 / 720 +
                            z * (1.0 / 40320 + z * (-1.0 / 3628800 +
                                                    z * (1.0 / 479001600.0 -
                                                         z * (1.0 / 87178291200.0 -
                                                              z * (1.0 / 20922789888000.0))))))));
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
