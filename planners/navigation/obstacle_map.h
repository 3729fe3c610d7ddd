#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "env/sensing/scan.h"
#include "planners/navigation/costmap.h"
#include "planners/navigation/footprint.h"
#include "planners/navigation/inflation.h"

/// Frames: `O` odometry, `R` the robot.

namespace slalom::planners {

/// Settings of an obstacle map.
struct ObstacleMapConfig {
  int num_cells = 200;            ///< Cells of each side.
  double resolution = 0.05;       ///< [m]
  bool rolling = true;            ///< Whether it moves with the robot, by whole cells.
  double obstacle_range = 2.5;    ///< Beams that end nearer than this mark obstacles, [m].
  double raytrace_range = 3.0;    ///< Beams clear cells up to here, [m].
  double inflation_radius = 0.3;  ///< [m]
  double cost_scaling = 10.0;     ///< [1/m]
  bool marks_stay = false;  ///< Clear under the robot first, so that what is seen there stays.
};

/// A square costmap that is filled from a robot's range finder: costmap_2d with an obstacle layer
/// and an inflation layer, in which unknown space counts as free.
///
/// Each update first clears the cells along every beam, including its end, up to the raytrace
/// range. Then it marks the cells in which beams hit an obstacle nearer than the obstacle range,
/// and clears the cells under the robot (its padded outline). So an obstacle between the two ranges
/// is cleared, not marked, as in ROS. A beam without an echo does nothing:
/// `ObstacleLayer::laserScanCallback` projects the scan by laser_geometry's `LaserProjection`,
/// which drops ranges from range_max on (`inf_is_valid` is false by default). Confined to one
/// thread at a time.
class ObstacleMap {
 public:
  /// Requires: num_cells >= 1, resolution > 0.
  ObstacleMap(const ObstacleMapConfig& config, const PaddedFootprint& footprint);

  /// Forgets all obstacles and moves the map's centre to `centre_O`.
  void Reset(base::Vec2 centre_O);

  /// Updates the map from a scan with the robot at X_OR. Returns a window that contains all changed
  /// costs; it is the whole map if the map moved. Costs are computed near the obstacles that came
  /// or went. Cost: O(beams * their cells), a few 10 us for 720 beams.
  CellWindow Update(const env::ScanRays& scan, const base::Pose2& X_OR);

  /// Takes a scan likewise, and leaves all costs to the next update: a fraction of its work.
  void Mark(const env::ScanRays& scan, const base::Pose2& X_OR);

  /// Forgets the obstacles outside the axis-parallel square around `p_O` whose side is `side` [m].
  /// Returns a window that contains all changed costs.
  CellWindow ClearOutside(base::Vec2 p_O, double side);

  const Costmap& costmap() const { return costmap_; }
  /// [size_y, size_x], kLethalCost where an obstacle was seen, else kFreeCost.
  const std::vector<std::uint8_t>& obstacles() const { return obstacles_; }

 private:
  bool RollTo(base::Vec2 centre_O);
  void Take(const env::ScanRays& scan, const base::Pose2& X_OR);
  void Trace(const env::ScanRays& scan);
  CellWindow WindowAround(base::Vec2 p_O, double radius) const;
  CellWindow WholeMap() const { return {0, 0, costmap_.size_x(), costmap_.size_y()}; }
  CellWindow InflateChanges(const CellWindow& window);

  const ObstacleMapConfig config_;
  const PaddedFootprint footprint_;
  const Inflation inflation_;
  Costmap costmap_;
  std::vector<std::uint8_t> obstacles_;
  bool stale_ = true;                        // Whether costs are out of date somewhere.
  std::vector<std::uint8_t> before_;         // A window's obstacles before an update.
  std::vector<std::uint8_t> changed_tiles_;  // Whether a square of kTile cells has wrong costs.
  std::vector<std::size_t> marks_;           // Cells to mark.
  std::vector<CellIndex> under_robot_;       // Cells to clear.
};

}  // namespace slalom::planners
