#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "planners/dwa/dwa_config.h"
#include "planners/navigation/local_planner.h"

/// Frames: `O` odometry, `R` the robot. Shapes: `N` commands.

namespace slalom::planners {

/// The poses through which a robot goes for `sim_time` under each of some commands.
///
/// In a step the velocity approaches the command, as far as the accelerations allow, and the robot
/// moves along its heading, then turns. Steps are as long as `sim_granularity` or
/// `angular_sim_granularity` ask for. Confined to one thread at a time; allocates when there are
/// more poses than before.
class CommandRollouts {
 public:
  /// A pose, with its heading's sine and cosine.
  struct Pose {
    base::Pose2 X_OR;
    base::SinCosResult heading;
  };

  /// Simulates the commands [N] from X_OR and `velocity`. Cost: about 20 us for 120 commands.
  void Simulate(const DwaConfig& config, const base::Pose2& X_OR, Twist velocity,
                std::span<const Twist> commands);

  /// Number of a command's poses, the one at its beginning included. Requires: i < N.
  int num_poses(std::size_t i) const { return num_poses_[i]; }
  /// Requires: i < N, 0 <= k < num_poses(i).
  Pose pose(std::size_t i, int k) const;

 private:
  static constexpr std::size_t kLanes = 8;

  /// Eight commands' k-th poses.
  struct PoseLanes {
    double x[kLanes], y[kLanes], yaw[kLanes], sin[kLanes], cos[kLanes];
  };
  struct StepLanes;

  static void SimulateLanes(const StepLanes& steps, const base::Pose2& X_OR, Twist velocity,
                            int num_poses, PoseLanes* poses);

  std::vector<int> num_poses_;       // [N]
  std::vector<std::size_t> begins_;  // [N / kLanes], of the lanes' poses.
  std::vector<PoseLanes> poses_;
};

}  // namespace slalom::planners
