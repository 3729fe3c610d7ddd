#include "planners/teb/timed_band.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"

namespace slalom::planners {
namespace {

/// The poses that were passed since the last cycle are searched among this many.
constexpr int kMaxPassed = 10;
/// The shortest time between two poses, [s].
constexpr double kLeastTime = 1e-3;

double TimeBetween(const base::Pose2& from, const base::Pose2& to, double max_linear,
                   double max_angular) {
  return std::max({base::Norm(to.p - from.p) / max_linear,
                   std::abs(base::WrapAngle(to.yaw - from.yaw)) / max_angular, kLeastTime});
}

base::Pose2 Middle(const base::Pose2& a, const base::Pose2& b) {
  return {0.5 * (a.p + b.p), base::WrapAngle(a.yaw + 0.5 * base::WrapAngle(b.yaw - a.yaw))};
}

}  // namespace

double TimedBand::Duration() const { return std::accumulate(dts.begin(), dts.end(), 0.0); }

TimedBand MakeBand(std::span<const base::Vec2> points, double start_yaw, double goal_yaw,
                   double max_linear, double max_angular, int min_samples) {
  SLALOM_CHECK_GE(points.size(), 2u);
  TimedBand band;
  const base::Pose2 goal{points.back(), goal_yaw};
  const auto append = [&](const base::Pose2& pose) {
    band.dts.push_back(TimeBetween(band.poses.back(), pose, max_linear, max_angular));
    band.poses.push_back(pose);
  };
  band.poses.push_back({points.front(), start_yaw});
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const base::Vec2 ahead = points[i + 1] - points[i];
    append({points[i], std::atan2(ahead.y, ahead.x)});
  }
  while (static_cast<int>(band.poses.size()) < min_samples - 1) {
    append(Middle(band.poses.back(), goal));
  }
  append(goal);
  return band;
}

void ResizeBand(double dt_ref, double dt_hysteresis, int min_samples, int max_samples,
                TimedBand& band) {
  std::vector<base::Pose2>& poses = band.poses;
  std::vector<double>& dts = band.dts;
  const auto size = [&] { return static_cast<int>(dts.size()); };
  for (int i = 0; i < size(); ++i) {
    if (dts[i] > dt_ref + dt_hysteresis && size() < max_samples) {
      if (dts[i] > 2.0 * dt_ref) {
        dts[i] *= 0.5;
        poses.insert(poses.begin() + i + 1, Middle(poses[i], poses[i + 1]));
        dts.insert(dts.begin() + i + 1, dts[i]);
        --i;
      } else if (i + 1 < size()) {
        dts[i + 1] += dts[i] - dt_ref;
        dts[i] = dt_ref;
      }
    } else if (dts[i] < dt_ref - dt_hysteresis && size() > min_samples) {
      if (i + 1 < size()) {
        dts[i + 1] += dts[i];
        dts.erase(dts.begin() + i);
        poses.erase(poses.begin() + i + 1);
        --i;
      } else {
        dts[i - 1] += dts[i];
        dts.erase(dts.begin() + i);
        poses.erase(poses.begin() + i);
      }
    }
  }
}

void MoveEnds(const base::Pose2& start, const base::Pose2& goal, int min_samples, TimedBand& band) {
  std::vector<base::Pose2>& poses = band.poses;
  const int last = std::min(static_cast<int>(poses.size()) - min_samples, kMaxPassed);
  int nearest = 0;
  while (nearest < last &&
         base::Norm(start.p - poses[nearest + 1].p) < base::Norm(start.p - poses[nearest].p)) {
    ++nearest;
  }
  poses.erase(poses.begin() + 1, poses.begin() + 1 + nearest);
  band.dts.erase(band.dts.begin(), band.dts.begin() + nearest);
  poses.front() = start;
  poses.back() = goal;
}

}  // namespace slalom::planners
