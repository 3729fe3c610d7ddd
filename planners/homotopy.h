#pragma once

#include <functional>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "planners/clearance_map.h"
#include "planners/costmap.h"

/// On which side of which obstacle a path passes, and a search for paths on other sides.

namespace slalom::planners {

/// Groups lethal cells of which no two neighbours are farther apart than `gap` [m], and writes one
/// cell's centre of each: a point for every obstacle as a robot that does not fit through `gap`
/// sees them. Confined to one thread at a time.
class ObstacleGroups {
 public:
  /// Looks at the lethal cells less than `reach` from `p_O`. Cost: cells * (gap / resolution)^2.
  std::span<const base::Vec2> Find(const Costmap& costmap, base::Vec2 p_O, double reach,
                                   double gap);

 private:
  std::vector<base::Vec2> points_O_;
  std::vector<char> is_open_;  // [cells] lethal, in reach and not in a group yet.
  std::vector<CellIndex> wave_;
};

/// The angle by which a path turns about each point, [rad].
///
/// Two paths between the same ends can be bent into each other without crossing any of the points
/// only if these are the same; else they differ by whole turns. This is what the H-signature of
/// Bhattacharya et al. 2010 sums up in one complex number; kept apart, nothing needs a threshold.
using HomotopyClass = std::vector<double>;
HomotopyClass ClassOf(std::span<const base::Vec2> path, std::span<const base::Vec2> points);
bool SameClass(const HomotopyClass& a, const HomotopyClass& b);

/// The roadmap of teb_local_planner: random points between start and goal, joined where the
/// straight way leads towards the goal and is clear.
struct RoadmapConfig {
  int num_samples = 15;
  double width = 6.0;               ///< Of the area across the line from start to goal, [m].
  double heading_threshold = 0.45;  ///< Cosine to that line which an edge must exceed, not below 0.
  double min_clearance = 0.25;      ///< Of edges from lethal cells, [m].
  int max_paths = 500;              ///< That are shown.
};

/// Draws a roadmap and shows its ways from start to goal to `visit`, until that returns false.
/// `start` and `goal` in the frame of `clearance`.
void SearchRoadmap(const RoadmapConfig& config, base::Vec2 start, base::Vec2 goal,
                   const ClearanceMap& clearance, base::Random& random,
                   const std::function<bool(std::span<const base::Vec2>)>& visit);

}  // namespace slalom::planners
