#pragma once

#include "base/vector_clones.h"

/// What the sine and cosine of an angle are computed from, alike for one number and for several
/// side by side (`T`: a double, or a vector of them), with the same bits. For use inside `.cc`
/// files only.

namespace slalom::base {

template <class T>
struct SinCosParts {
  T sin, cos;
};

/// angle - n pi/2 for a whole n, after Cody and Waite in three parts.
template <class T>
SLALOM_ALWAYS_INLINE T WithoutQuarters(T angle, T n) {
  constexpr double kPio2High = 1.57079632673412561417e+00;
  constexpr double kPio2Mid = 6.07710050630396597660e-11;
  constexpr double kPio2Low = 2.02226624879595063154e-21;
  return ((angle - n * kPio2High) - n * kPio2Mid) - n * kPio2Low;
}

/// Sine and cosine of r in [-pi/4, pi/4], by Taylor polynomials whose truncation there is below
/// 1e-16.
template <class T>
SLALOM_ALWAYS_INLINE SinCosParts<T> SinCosNearZero(T r) {
  const T z = r * r;
  const T sin_r =
      r + r * z *
              (-1.0 / 6 +
               z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 +
                                                        z * (-1.0 / 39916800 +
                                                             z * (1.0 / 6227020800.0 -
                                                                  z * (1.0 / 1307674368000.0)))))));
  const T cos_r =
      1.0 +
      z * (-0.5 + z * (1.0 / 24 +
                       z * (-1.0 / 720 +
                            z * (1.0 / 40320 + z * (-1.0 / 3628800 +
                                                    z * (1.0 / 479001600.0 -
                                                         z * (1.0 / 87178291200.0 -
                                                              z * (1.0 / 20922789888000.0))))))));
  return {sin_r, cos_r};
}

}  // namespace slalom::base
