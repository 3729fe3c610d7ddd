#include "sim/courses/motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/check.h"

namespace slalom::sim {
namespace {

/// Slopes per u of the values at the key frames.
std::vector<double> Tangents(const std::vector<double>& values, bool closed) {
  const std::size_t last = values.size() - 1;
  std::vector<double> tangents(values.size());
  for (std::size_t i = 1; i < last; ++i) tangents[i] = 0.5 * (values[i + 1] - values[i - 1]);
  if (closed) {
    tangents[0] = tangents[last] = 0.5 * (values[1] - values[last - 1]);
  } else {
    tangents[0] = 0.5 * (values[1] - values[0]);
    tangents[last] = 0.5 * (values[last] - values[last - 1]);
  }
  return tangents;
}

/// Largest |c1 + 2 c2 u + 3 c3 u^2| for u in [0, 1].
double MaxSlope(double c1, double c2, double c3) {
  const auto slope = [&](double u) { return std::abs(c1 + u * (2.0 * c2 + u * 3.0 * c3)); };
  double largest = std::max(slope(0.0), slope(1.0));
  if (c3 != 0.0) largest = std::max(largest, slope(std::clamp(-c2 / (3.0 * c3), 0.0, 1.0)));
  return largest;
}

}  // namespace

Motion::Motion(const MovingObstacle& obstacle) : loops_(obstacle.playback == Playback::kLoop) {
  const std::vector<KeyFrame>& frames = obstacle.key_frames;
  SLALOM_CHECK_GE(frames.size(), 2u);
  SLALOM_CHECK_EQ(frames.front().time, 0.0);
  std::vector<double> x, y;
  for (const KeyFrame& frame : frames) {
    x.push_back(frame.X_WB.p.x);
    y.push_back(frame.X_WB.p.y);
  }
  const bool closed = frames.front().X_WB.p == frames.back().X_WB.p;
  const std::vector<double> dx = Tangents(x, closed), dy = Tangents(y, closed);
  double yaw = frames.front().X_WB.yaw;
  for (std::size_t i = 0; i + 1 < frames.size(); ++i) {
    const double duration = frames[i + 1].time - frames[i].time;
    SLALOM_CHECK_GT(duration, 0.0);
    const auto cubic = [i](const std::vector<double>& p, const std::vector<double>& d) {
      const double way = p[i + 1] - p[i];
      return Cubic{p[i], d[i], 3.0 * way - 2.0 * d[i] - d[i + 1], d[i] + d[i + 1] - 2.0 * way};
    };
    const KeyFrameInterval interval{.begin = frames[i].time,
                                    .inverse_duration = 1.0 / duration,
                                    .x = cubic(x, dx),
                                    .y = cubic(y, dy),
                                    .yaw = yaw,
                                    .yaw_step = base::WrapAngle(frames[i + 1].X_WB.yaw - yaw)};
    yaw += interval.yaw_step;
    const auto max_rate = [&](const Cubic& c) {
      return interval.inverse_duration * MaxSlope(c.c1, c.c2, c.c3);
    };
    max_speed_ = std::max(max_speed_, base::Norm({max_rate(interval.x), max_rate(interval.y)}));
    max_yaw_rate_ =
        std::max(max_yaw_rate_, interval.inverse_duration * std::abs(interval.yaw_step));
    intervals_.push_back(interval);
  }
  one_way_ = frames.back().time;
  period_ = loops_ ? one_way_ : 2.0 * one_way_;
}

MotionState Motion::At(double time) const {
  SLALOM_CHECK_GE(time, 0.0);
  double t = std::fmod(time, period_);
  const bool back = t > one_way_;
  if (back) t = period_ - t;
  std::size_t i = intervals_.size() - 1;
  if (i > 0) {
    const auto after = std::upper_bound(
        intervals_.begin() + 1, intervals_.end(), t,
        [](double value, const KeyFrameInterval& interval) { return value < interval.begin; });
    i = static_cast<std::size_t>(after - intervals_.begin()) - 1;
  }
  const KeyFrameInterval& interval = intervals_[i];
  const double u = (t - interval.begin) * interval.inverse_duration;
  const double rate = back ? -interval.inverse_duration : interval.inverse_duration;
  const auto value = [u](const Cubic& c) { return c.c0 + u * (c.c1 + u * (c.c2 + u * c.c3)); };
  const auto slope = [u, rate](const Cubic& c) {
    return rate * (c.c1 + u * (2.0 * c.c2 + u * 3.0 * c.c3));
  };
  return {.X_WB = {{value(interval.x), value(interval.y)}, interval.yaw + u * interval.yaw_step},
          .v_B = {slope(interval.x), slope(interval.y)},
          .yaw_rate = rate * interval.yaw_step};
}

bool Motion::BeginsRound(double time, double duration) const {
  return loops_ && std::fmod(time, period_) + duration >= period_;
}

}  // namespace slalom::sim
