#include "planners/dwa/command_rollouts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/sin_cos_parts.h"
#include "base/vector_clones.h"

namespace slalom::planners {
namespace {

constexpr int kLaneCount = 8;

using Doubles = double __attribute__((vector_size(8 * kLaneCount)));
using Longs = std::int64_t __attribute__((vector_size(8 * kLaneCount)));

SLALOM_ALWAYS_INLINE Doubles Load(const double* from) {
  Doubles v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
SLALOM_ALWAYS_INLINE void Store(double* to, Doubles v) { std::memcpy(to, &v, sizeof v); }
SLALOM_ALWAYS_INLINE Doubles Fill(double x) { return Doubles{} + x; }

/// The same bits as base::SinCos.
SLALOM_ALWAYS_INLINE base::SinCosParts<Doubles> SinCos(Doubles angle) {
  constexpr double kWhole = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers.
  const Doubles quarters = angle * (2.0 / base::kPi) + 0.5;
  const Doubles rounded = (quarters + kWhole) - kWhole;
  const Doubles n = rounded > quarters ? rounded - 1.0 : rounded;
  const base::SinCosParts<Doubles> near = base::SinCosNearZero(base::WithoutQuarters(angle, n));
  const Doubles with_quadrant = n + kWhole;
  Longs quadrant;
  std::memcpy(&quadrant, &with_quadrant, sizeof quadrant);
  const Longs swap = (quadrant & 1) != 0;
  const Doubles sine = swap ? near.cos : near.sin, cosine = swap ? near.sin : near.cos;
  const Longs below = (quadrant & 2) != 0, left = ((quadrant + 1) & 2) != 0;
  return {below ? -sine : sine, left ? -cosine : cosine};
}

/// Speed after a step that changes it by `most`, on the way from `now` to `wanted`.
SLALOM_ALWAYS_INLINE Doubles Approach(Doubles wanted, Doubles now, Doubles most) {
  const Doubles faster = now + most, slower = now - most;
  const Doubles up = faster < wanted ? faster : wanted;
  const Doubles down = wanted < slower ? slower : wanted;
  return wanted >= now ? up : down;
}

}  // namespace

/// What eight commands are simulated with.
struct CommandRollouts::StepLanes {
  double linear[kLanes] = {}, angular[kLanes] = {};
  double dt[kLanes] = {};
  double most_linear[kLanes] = {}, most_angular[kLanes] = {};  // Change of speed in a step.
};

void CommandRollouts::Simulate(const DwaConfig& config, const base::Pose2& X_OR, Twist velocity,
                               std::span<const Twist> commands) {
  num_poses_.clear();
  begins_.clear();
  std::size_t end = 0;
  for (std::size_t first = 0; first < commands.size(); first += kLanes) {
    const auto lanes = commands.subspan(first, std::min(kLanes, commands.size() - first));
    StepLanes steps;
    int most_poses = 1;
    for (std::size_t lane = 0; lane < lanes.size(); ++lane) {
      const Twist command = lanes[lane];
      const double poses =
          std::max(std::fabs(command.linear) * config.sim_time / config.sim_granularity,
                   std::fabs(command.angular) / config.angular_sim_granularity);
      const int num_poses = std::max(1, static_cast<int>(std::lround(poses)));
      const double dt = config.sim_time / num_poses;
      steps.linear[lane] = command.linear;
      steps.angular[lane] = command.angular;
      steps.dt[lane] = dt;
      steps.most_linear[lane] = config.acceleration * dt;
      steps.most_angular[lane] = config.turn_acceleration * dt;
      num_poses_.push_back(num_poses);
      most_poses = std::max(most_poses, num_poses);
    }
    begins_.push_back(end);
    end += static_cast<std::size_t>(most_poses);
    if (poses_.size() < end) poses_.resize(end);
    SimulateLanes(steps, X_OR, velocity, most_poses, &poses_[begins_.back()]);
  }
}

CommandRollouts::Pose CommandRollouts::pose(std::size_t i, int k) const {
  const PoseLanes& lanes = poses_[begins_[i / kLanes] + static_cast<std::size_t>(k)];
  const std::size_t lane = i % kLanes;
  return {{{lanes.x[lane], lanes.y[lane]}, lanes.yaw[lane]}, {lanes.sin[lane], lanes.cos[lane]}};
}

/// Commands that need fewer poses than the others go on beyond their last.
SLALOM_SIMD void CommandRollouts::SimulateLanes(const StepLanes& steps, const base::Pose2& X_OR,
                                                Twist velocity, int num_poses, PoseLanes* poses) {
  static_assert(kLanes == kLaneCount);
  const Doubles wanted_linear = Load(steps.linear), wanted_angular = Load(steps.angular);
  const Doubles most_linear = Load(steps.most_linear), most_angular = Load(steps.most_angular);
  const Doubles dt = Load(steps.dt);
  Doubles x = Fill(X_OR.p.x), y = Fill(X_OR.p.y), yaw = Fill(X_OR.yaw);
  Doubles linear = Fill(velocity.linear), angular = Fill(velocity.angular);
  for (int k = 0; k < num_poses; ++k) {
    const base::SinCosParts<Doubles> heading = SinCos(yaw);
    Store(poses[k].x, x);
    Store(poses[k].y, y);
    Store(poses[k].yaw, yaw);
    Store(poses[k].sin, heading.sin);
    Store(poses[k].cos, heading.cos);
    linear = Approach(wanted_linear, linear, most_linear);
    angular = Approach(wanted_angular, angular, most_angular);
    const Doubles way = linear * dt;
    x = x + way * heading.cos;
    y = y + way * heading.sin;
    yaw = yaw + angular * dt;
  }
}

}  // namespace slalom::planners
