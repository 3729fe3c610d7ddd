#pragma once

#include <span>
#include <vector>

#include "base/geometry.h"

namespace slalom::planners {

/// The part of a global plan that a local planner follows, points at equal distances. A value.
struct LocalPath {
  std::vector<base::Vec2> points;  ///< [n], n >= 1, [m].
  double spacing = 0.0;            ///< Between points, save before the last, [m].
  bool ends_at_goal = false;       ///< The last point is the plan's last.
};

/// Writes the part of `path` from the point nearest to `p` on for `length`, at `spacing`.
///
/// Nearest is sought along the first `search_length` of the path, so that a way back beside the way
/// out is not taken for it. Requires: !path.empty(), spacing > 0, [m].
void CutLocalPath(std::span<const base::Vec2> path, base::Vec2 p, double search_length,
                  double length, double spacing, LocalPath& local);

}  // namespace slalom::planners
