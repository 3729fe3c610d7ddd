#include "planners/navigation/local_path.h"

#include <algorithm>
#include <limits>

#include "base/check.h"

namespace slalom::planners {
namespace {

struct PlaceOnPath {
  std::size_t segment = 0;  // From path[segment] to path[segment + 1].
  base::Vec2 p;
};

/// The point of the segment a-b nearest to p.
base::Vec2 NearestOnSegment(base::Vec2 a, base::Vec2 b, base::Vec2 p) {
  const base::Vec2 ab = b - a;
  const double squared_length = base::Dot(ab, ab);
  if (squared_length == 0.0) return a;
  const double share = std::clamp(base::Dot(p - a, ab) / squared_length, 0.0, 1.0);
  return a + share * ab;
}

PlaceOnPath FindNearest(std::span<const base::Vec2> path, base::Vec2 p, double search_length) {
  PlaceOnPath nearest{0, path.front()};
  double nearest_distance = std::numeric_limits<double>::infinity();
  double walked = 0.0;
  for (std::size_t i = 0; i + 1 < path.size() && walked <= search_length; ++i) {
    const base::Vec2 candidate = NearestOnSegment(path[i], path[i + 1], p);
    const double distance = base::Norm(candidate - p);
    if (distance < nearest_distance) {
      nearest_distance = distance;
      nearest = {i, candidate};
    }
    walked += base::Norm(path[i + 1] - path[i]);
  }
  return nearest;
}

}  // namespace

void CutLocalPath(std::span<const base::Vec2> path, base::Vec2 p, double search_length,
                  double length, double spacing, LocalPath& local) {
  SLALOM_CHECK(!path.empty() && spacing > 0.0);
  const PlaceOnPath start = FindNearest(path, p, search_length);
  local.points.assign(1, start.p);
  local.spacing = spacing;
  local.ends_at_goal = true;
  base::Vec2 from = start.p;
  double walked = 0.0;    // Length from the start to `from`.
  double next = spacing;  // Length from the start to the next point to write.
  for (std::size_t i = start.segment + 1; i < path.size(); ++i) {
    const double segment = base::Norm(path[i] - from);
    while (next <= walked + segment) {
      if (next > length) {
        local.ends_at_goal = false;
        return;
      }
      const double share = segment > 0.0 ? (next - walked) / segment : 0.0;
      local.points.push_back(from + share * (path[i] - from));
      next += spacing;
    }
    walked += segment;
    from = path[i];
  }
  if (!(local.points.back() == path.back())) local.points.push_back(path.back());
}

}  // namespace slalom::planners
