#pragma once

#include <limits>
#include <string>
#include <vector>

#include "app/sweep/plan.h"

namespace slalom::sweep {

/// One setting of every axis.
struct Point {
  base::TomlAssignments set;                        ///< Settings of the axes, in their order.
  std::vector<std::string> labels;                  ///< One for each axis.
  int max_seeds = std::numeric_limits<int>::max();  ///< Largest number of seeds.
};

/// The product of the axes, the last one changing fastest. Without any axis, one empty point.
/// Throws `base::Error` that names the place of a value that does not have one element for each of
/// its axis' keys.
std::vector<Point> Product(const std::vector<const Axis*>& axes);

/// Name of an axis in tables.
std::string AxisName(const Axis& axis);

/// Name of each of its values.
std::vector<std::string> AxisLabels(const Axis& axis);

/// The axis with `columns = true`, or null if there is none.
const Axis* ColumnAxis(const Plan& plan);

}  // namespace slalom::sweep
