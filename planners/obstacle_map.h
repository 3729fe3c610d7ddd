#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "planners/costmap.h"
#include "planners/footprint.h"
#include "planners/inflation.h"
#include "planners/scan.h"

/// Frames: `O` odometry, `R` the robot.

namespace slalom::planners {

/// What an obstacle map is made of.
struct ObstacleMapConfig {
  int num_cells = 200;            ///< Each side.
  double resolution = 0.05;       ///< [m]
  bool rolling = true;            ///< Follows the robot by whole cells; else stays.
  double obstacle_range = 2.5;    ///< Nearer ends of beams become obstacles, [m].
  double raytrace_range = 3.0;    ///< Beams clear up to here, [m].
  double inflation_radius = 0.3;  ///< [m]
  double cost_scaling = 10.0;     ///< [1/m]
};

/// A square costmap that a robot fills with what its range finder sees: costmap_2d with an obstacle
/// layer and an inflation layer, unknown space counting as free.
///
/// Each update first clears the cells along every beam, its end included, up to the raytrace range;
/// then marks the cells in which beams ended at an obstacle nearer than the obstacle range; then
/// clears the cells under the robot. So an obstacle between the two ranges is cleared, not marked,
/// as in ROS. Confined to one thread at a time.
class ObstacleMap {
 public:
  /// Requires: num_cells >= 1, resolution > 0.
  ObstacleMap(const ObstacleMapConfig& config, const Footprint& footprint);

  /// Forgets all obstacles; the map's centre comes to `centre_O`.
  void Reset(base::Vec2 centre_O);

  /// Takes in a scan with the robot at X_OR. Returns a window that holds all costs that changed;
  /// the whole map where it moved.
  CellWindow Update(const ScanRays& scan, const base::Pose2& X_OR);

  /// Forgets the obstacles outside the axis-parallel square of this side [m] round `p_O`. Returns
  /// a window that holds all costs that changed.
  CellWindow ClearOutside(base::Vec2 p_O, double side);

  const Costmap& costmap() const { return costmap_; }
  /// [size_y, size_x]: kLethalCost where an obstacle was seen, else kFreeCost.
  const std::vector<std::uint8_t>& obstacles() const { return obstacles_; }

 private:
  void RollTo(base::Vec2 centre_O);
  void Trace(const ScanRays& scan);
  CellWindow WindowAround(base::Vec2 p_O, double radius) const;
  CellWindow WholeMap() const { return {0, 0, costmap_.size_x(), costmap_.size_y()}; }
  CellWindow Write(CellWindow window);

  const ObstacleMapConfig config_;
  const Footprint footprint_;
  const Inflation inflation_;
  Costmap costmap_;
  std::vector<std::uint8_t> obstacles_;
  bool stale_ = true;                   // The costs do not follow from the obstacles everywhere.
  std::vector<std::uint8_t> before_;    // A window's obstacles before an update.
  std::vector<std::size_t> marks_;      // Cells to mark.
  std::vector<CellIndex> under_robot_;  // Cells to clear.
};

}  // namespace slalom::planners
