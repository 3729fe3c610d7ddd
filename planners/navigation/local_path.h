#pragma once

#include <span>
#include <vector>

#include "base/geometry.h"

namespace slalom::planners {

/// The part of a global plan that a local planner follows, as points at equal distances. A value.
struct LocalPath {
  std::vector<base::Vec2> points;  ///< [n], n >= 1, [m].
  double spacing = 0.0;            ///< Between points; the last may be nearer, [m].
  bool ends_at_goal = false;       ///< The last point is the plan's last.
};

/// Writes the part of `path` that begins at the point nearest to `p` and is `length` long, at
/// `spacing`.
///
/// The nearest point is sought only along the first `search_length` of the path, so that a later
/// part of the path that comes back close to `p` is not mistaken for it. Requires: !path.empty(),
/// spacing > 0, [m].
void CutLocalPath(std::span<const base::Vec2> path, base::Vec2 p, double search_length,
                  double length, double spacing, LocalPath& local);

}  // namespace slalom::planners
