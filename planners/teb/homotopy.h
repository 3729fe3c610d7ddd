#pragma once

#include <functional>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "planners/navigation/clearance_map.h"
#include "planners/navigation/costmap.h"

/// Homotopy classes: on which side of each obstacle a path passes, and a search for paths that pass
/// on other sides.

namespace slalom::planners {

/// Groups lethal cells that are at most `gap` [m] apart, and represents each group by the centre of
/// one cell. For a robot that does not fit through `gap`, that is one point per obstacle. Confined
/// to one thread at a time.
class ObstacleGroups {
 public:
  /// Considers the lethal cells less than `reach` from `p_O`. Cost: cells * (gap / resolution)^2.
  std::span<const base::Vec2> Find(const Costmap& costmap, base::Vec2 p_O, double reach,
                                   double gap);

 private:
  std::vector<base::Vec2> points_O_;
  std::vector<char> is_open_;  // [cells] lethal, in reach and not in a group yet.
  std::vector<CellIndex> wave_;
};

/// The angle by which a path winds around each point, [rad].
///
/// Two paths between the same ends can be deformed into each other without crossing a point only if
/// all angles are the same; else some differ by whole turns. The H-signature of Bhattacharya et al.
/// 2010 sums the angles up in one complex number; kept separate, they need no threshold.
using HomotopyClass = std::vector<double>;
HomotopyClass ClassOf(std::span<const base::Vec2> path, std::span<const base::Vec2> points);
bool SameClass(const HomotopyClass& a, const HomotopyClass& b);

/// The roadmap of teb_local_planner: random points between start and goal, joined if the straight
/// way leads towards the goal and is clear.
struct RoadmapConfig {
  int num_samples = 15;
  double width = 6.0;               ///< Width of the area across the line from start to goal, [m].
  double heading_threshold = 0.45;  ///< Least cosine between an edge and that line, at least 0.
  double min_clearance = 0.25;      ///< Least distance of edges from lethal cells, [m].
  int max_paths = 500;              ///< Most paths that are visited.
};

/// Draws a roadmap and calls `visit` with its paths from start to goal, until that returns false.
/// `start` and `goal` are in the frame of `clearance`.
void SearchRoadmap(const RoadmapConfig& config, base::Vec2 start, base::Vec2 goal,
                   const ClearanceMap& clearance, base::Random& random,
                   const std::function<bool(std::span<const base::Vec2>)>& visit);

}  // namespace slalom::planners
