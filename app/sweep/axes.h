#pragma once

#include <string>
#include <vector>

#include "app/sweep/plan.h"

namespace slalom::sweep {

/// One setting of every axis.
struct Point {
  base::TomlAssignments set;        ///< What the axes set, in their order.
  std::vector<std::string> labels;  ///< One for each axis.
};

/// The product of the axes, the last one changing fastest. Without any axis, one empty point.
/// Throws `base::Error` that names the place of a value which has not one element for each of its
/// axis' keys.
std::vector<Point> Product(const std::vector<const Axis*>& axes);

/// What to call an axis in tables.
std::string AxisName(const Axis& axis);

}  // namespace slalom::sweep
