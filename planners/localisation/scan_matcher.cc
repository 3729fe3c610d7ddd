#include "planners/localisation/scan_matcher.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::planners {
namespace {

constexpr double kCellSize = 0.25;    // [m]
constexpr int kCellsPerSide = 128;    // A power of 2.
constexpr double kLeastRange = 0.05;  // Of an echo, [m].
constexpr int kLeastPoints = 6;       // In a cell that counts.
constexpr int kLeastScans = 3;        // That saw a cell that counts.
constexpr int kMostPoints = 400;      // A cell with as many is known.
constexpr double kMapError = 0.01;    // Of a cell's line, beside the spread of its points, [m].
constexpr double kInsertWay = 0.2;    // Between scans in the map, [m].
constexpr double kInsertTurn = 0.2;   // [rad]
constexpr int kMostSteps = 6;         // Of Gauss-Newton,
constexpr int kStepsWithSearch = 3;   // the first ones with cells anew.
constexpr double kLeastStep = 1e-4;   // [m], [rad]
// Points of a cell share its error: so much does each count.
constexpr double kPointWeight = 0.05;
// Standard deviations of what odometry says of a way of 1 m, and of a turn of 1 rad.
constexpr double kPositionError = 0.05;  // [m/m^0.5]
constexpr double kHeadingError = 0.02;   // [rad/m^0.5], [rad/rad^0.5]
constexpr double kLeastWay = 0.01;       // [m]

}  // namespace

ScanMatcher::ScanMatcher(const env::ScanGeometry& geometry)
    : geometry_(geometry), directions_R_(env::BeamDirections(geometry)) {}

void ScanMatcher::Reset() { num_scans_ = 0; }

base::Pose2 ScanMatcher::Match(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR) {
  ReadScan(ranges_cm);
  if (num_scans_ == 0) {
    cells_.assign(kCellsPerSide * kCellsPerSide, {});
    X_OR_ = X_MR_ = X_OR;
    Insert(X_OR);
    return X_OR;
  }
  const base::Vec2 moved_R = base::InverseTransform(X_OR_, X_OR.p);
  const double turned = base::WrapAngle(X_OR.yaw - X_OR_.yaw);
  const base::Pose2 predicted{base::Transform(X_MR_, moved_R), X_MR_.yaw + turned};
  const double way = std::max(base::Norm(moved_R), kLeastWay);
  const double position = 1.0 / (kPositionError * kPositionError * way);
  const double heading = 1.0 / (kHeadingError * kHeadingError * (way + std::abs(turned)));
  X_OR_ = X_OR;
  X_MR_ = predicted;
  for (int i = 0; i < kMostSteps; ++i) {
    if (i < kStepsWithSearch) FindPairs(X_MR_);
    if (Improve(predicted, {position, position, heading}, X_MR_) < kLeastStep) break;
  }
  X_MR_.yaw = base::WrapAngle(X_MR_.yaw);
  if (base::Norm(X_MR_.p - inserted_X_MR_.p) > kInsertWay ||
      std::abs(base::WrapAngle(X_MR_.yaw - inserted_X_MR_.yaw)) > kInsertTurn) {
    Insert(X_MR_);
  }
  return X_MR_;
}

void ScanMatcher::ReadScan(std::span<const std::uint16_t> ranges_cm) {
  SLALOM_CHECK_EQ(ranges_cm.size(), directions_R_.size());
  points_R_.clear();
  for (std::size_t i = 0; i < ranges_cm.size(); ++i) {
    const double range = 0.01 * ranges_cm[i];
    if (range < kLeastRange || range >= geometry_.clip) continue;
    points_R_.push_back(geometry_.p_RS + range * directions_R_[i]);
  }
}

ScanMatcher::Square ScanMatcher::SquareOf(base::Vec2 p_M) {
  return {static_cast<int>(std::floor(p_M.x / kCellSize)),
          static_cast<int>(std::floor(p_M.y / kCellSize))};
}

/// The cell of the square, which may still be that of another one.
ScanMatcher::Cell& ScanMatcher::CellAt(Square square) {
  constexpr int kLastBits = kCellsPerSide - 1;
  return cells_[(square.y & kLastBits) * kCellsPerSide + (square.x & kLastBits)];
}

/// Finds the cell that each point lies in, if it counts.
void ScanMatcher::FindPairs(const base::Pose2& X_MR) {
  pairs_.clear();
  const int least_scans = std::min(kLeastScans, num_scans_);
  const auto [s, c] = base::SinCos(X_MR.yaw);
  for (const base::Vec2 p_R : points_R_) {
    const Square square =
        SquareOf({X_MR.p.x + c * p_R.x - s * p_R.y, X_MR.p.y + s * p_R.x + c * p_R.y});
    const Cell& cell = CellAt(square);
    if (cell.square == square && cell.num_points >= kLeastPoints && cell.num_scans >= least_scans) {
      pairs_.push_back({p_R, &cell});
    }
  }
}

/// One step of Gauss-Newton. Returns its length, the longest of its numbers.
double ScanMatcher::Improve(const base::Pose2& predicted, const Eigen::Vector3d& weights,
                            base::Pose2& X_MR) const {
  const base::Vec2 moved = X_MR.p - predicted.p;
  Eigen::Matrix3d hessian = weights.asDiagonal();
  Eigen::Vector3d gradient =
      weights.cwiseProduct(Eigen::Vector3d(moved.x, moved.y, X_MR.yaw - predicted.yaw));
  const auto [s, c] = base::SinCos(X_MR.yaw);
  for (const Pair& pair : pairs_) {
    const base::Vec2 arm{c * pair.p_R.x - s * pair.p_R.y, s * pair.p_R.x + c * pair.p_R.y};
    const base::Vec2 n = pair.cell->normal_M;
    const double error = base::Dot(n, X_MR.p + arm - pair.cell->mean_M);
    const double information = pair.cell->information;
    const double weight = kPointWeight * information * std::exp(-0.5 * information * error * error);
    const Eigen::Vector3d slope{n.x, n.y, base::Cross(arm, n)};
    hessian.noalias() += (weight * slope) * slope.transpose();
    gradient += (weight * error) * slope;
  }
  const Eigen::Vector3d step = hessian.ldlt().solve(gradient);
  X_MR.p = X_MR.p - base::Vec2{step.x(), step.y()};
  X_MR.yaw -= step.z();
  return step.cwiseAbs().maxCoeff();
}

/// Adds the scan to the map.
void ScanMatcher::Insert(const base::Pose2& X_MR) {
  inserted_X_MR_ = X_MR;
  const int scan = num_scans_++;
  touched_.clear();
  const auto [s, c] = base::SinCos(X_MR.yaw);
  for (const base::Vec2 p_R : points_R_) {
    const base::Vec2 p_M{X_MR.p.x + c * p_R.x - s * p_R.y, X_MR.p.y + s * p_R.x + c * p_R.y};
    const Square square = SquareOf(p_M);
    Cell& cell = CellAt(square);
    if (cell.square != square) cell = {square};
    if (cell.last_scan != scan) {
      if (cell.num_points >= kMostPoints) continue;
      cell.last_scan = scan;
      ++cell.num_scans;
      touched_.push_back(&cell);
    }
    const double dx = p_M.x - kCellSize * square.x, dy = p_M.y - kCellSize * square.y;
    ++cell.num_points;
    cell.sum_x += dx;
    cell.sum_y += dy;
    cell.sum_xx += dx * dx;
    cell.sum_xy += dx * dy;
    cell.sum_yy += dy * dy;
  }
  for (Cell* cell : touched_) FitLine(*cell);
}

void ScanMatcher::FitLine(Cell& cell) {
  const double n = cell.num_points, x = cell.sum_x / n, y = cell.sum_y / n;
  const double xx = cell.sum_xx / n - x * x, xy = cell.sum_xy / n - x * y,
               yy = cell.sum_yy / n - y * y;
  // Across the line the points spread least: the smaller eigenvalue of their covariance.
  const double least = 0.5 * (xx + yy - std::hypot(xx - yy, 2.0 * xy));
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy) + 0.5 * base::kPi;
  const auto [sin, cos] = base::SinCos(angle);
  cell.mean_M = {kCellSize * cell.square.x + x, kCellSize * cell.square.y + y};
  cell.normal_M = {cos, sin};
  cell.information = 1.0 / (std::max(least, 0.0) + kMapError * kMapError);
}

}  // namespace slalom::planners
