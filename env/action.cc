#include "env/action.h"

#include <algorithm>

namespace slalom::env {

Action ActionBounds::Normalise(double linear, double angular) const {
  const double v = 2.0 * (linear - linear_min) / (linear_max - linear_min) - 1.0;
  const double w = angular / angular_max;
  return {static_cast<float>(std::clamp(v, -1.0, 1.0)),
          static_cast<float>(std::clamp(w, -1.0, 1.0))};
}

}  // namespace slalom::env
