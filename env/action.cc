#include "env/action.h"

#include <algorithm>

namespace slalom::env {

Action ActionBounds::Scale(double linear, double angular) const {
  return {static_cast<float>(2.0 * (linear - linear_min) / (linear_max - linear_min) - 1.0),
          static_cast<float>(angular / angular_max)};
}

Action ActionBounds::Normalise(double linear, double angular) const {
  const Action action = Scale(linear, angular);
  return {std::clamp(action.linear, -1.0f, 1.0f), std::clamp(action.angular, -1.0f, 1.0f)};
}

}  // namespace slalom::env
