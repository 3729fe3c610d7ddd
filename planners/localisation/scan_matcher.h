#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "env/sensing/scan.h"

/// Frames: `O` odometry, which drifts, `M` the map, equal to O where an episode begins, `R` the
/// robot. Shapes: `N` beams.

namespace slalom::planners {

/// Tells a robot where it is on a map that it makes of its own scans: what odometry says of the
/// last step, corrected so that the scan lies on what earlier scans have shown.
///
/// The map has a line through the points of each cell, with their spread across it, after Biber and
/// Strasser's normal distributions ("The normal distributions transform", IROS 2003). A scan is
/// matched by Gauss-Newton steps from the pose that odometry predicts, which also counts as a
/// measurement: along a bare wall it is all there is. Cells count once several scans have seen
/// them, so what moves counts little. There is no loop closure: errors add up, slowly, where the
/// robot sees new ground. Ground more than 16 m away is forgotten when other ground needs its
/// place.
///
/// Confined to one thread at a time. Allocates nothing after the first scans. Cost: about 0.1 ms a
/// scan; 2 MB.
class ScanMatcher {
 public:
  explicit ScanMatcher(const env::ScanGeometry& geometry);

  /// Forgets everything. The next pose becomes the one that odometry says.
  void Reset();

  /// Takes the scan `ranges_cm` [N] [cm] and the pose that odometry says it was taken at. Returns
  /// the pose X_MR. Requires: ranges_cm.size() == num_beams.
  base::Pose2 Match(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR);

 private:
  /// A square of the ground, by its place among them.
  struct Square {
    int x = 0, y = 0;

    friend bool operator==(const Square&, const Square&) = default;
  };

  /// The points that fell into a square.
  struct Cell {
    Square square;
    int num_points = 0, num_scans = 0, last_scan = -1;
    // Sums over the points, relative to the square's corner, [m], [m^2].
    double sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0, sum_yy = 0.0;
    // Of the line through them.
    base::Vec2 mean_M{}, normal_M{};
    double information = 0.0;  // Across the line, [1/m^2].
  };

  /// A point of the scan beside the cell that it lies in.
  struct Pair {
    base::Vec2 p_R;
    const Cell* cell;
  };

  static void FitLine(Cell& cell);
  void ReadScan(std::span<const std::uint16_t> ranges_cm);
  static Square SquareOf(base::Vec2 p_M);
  Cell& CellAt(Square square);
  void FindPairs(const base::Pose2& X_MR);
  double Improve(const base::Pose2& predicted, const Eigen::Vector3d& weights,
                 base::Pose2& X_MR) const;
  void Insert(const base::Pose2& X_MR);

  const env::ScanGeometry geometry_;
  const std::vector<base::Vec2> directions_R_;  // [N]
  std::vector<base::Vec2> points_R_;            // Of the scan, those with an echo, [m].
  std::vector<Pair> pairs_;
  std::vector<Cell> cells_;  // By the last bits of x and y.
  std::vector<Cell*> touched_;
  int num_scans_ = 0;                        // In the map.
  base::Pose2 X_OR_, X_MR_, inserted_X_MR_;  // Of the last scan; of the last one in the map.
};

}  // namespace slalom::planners
