#pragma once

#include <cstddef>
#include <span>
#include <vector>

/// Shapes: `B` rollouts in a batch, `T` steps of a rollout. Arrays are [T, B], so that what is done
/// to a step of all rollouts runs over neighbours.
/// Frames: `L` axes of O at the robot's place when the control cycle began.

namespace slalom::planners {

/// What a differential drive can do in a step.
struct DriveLimits {
  float max_linear_step = 0.0f;   ///< Largest change of speed in a step, [m/s].
  float max_angular_step = 0.0f;  ///< Of turn rate, [rad/s].
  float dt = 0.0f;                ///< [s]
};

/// Where a rollout begins, in L: at the origin.
struct RolloutStart {
  float cosine = 1.0f, sine = 0.0f;  ///< Of the heading in L.
  float linear = 0.0f;               ///< [m/s]
  float angular = 0.0f;              ///< [rad/s]
};

/// Sampled controls of B robots and where they lead. A value; nothing is allocated after
/// construction.
struct Rollouts {
  /// Requires: batch_size >= 1, num_steps >= 1.
  Rollouts(int new_batch_size, int new_num_steps);

  std::size_t Index(int t, int b) const {
    return static_cast<std::size_t>(t) * static_cast<std::size_t>(batch_size) +
           static_cast<std::size_t>(b);
  }

  int batch_size;
  int num_steps;
  std::vector<float> control_linear;   ///< [T, B] commanded during step t, [m/s].
  std::vector<float> control_angular;  ///< [T, B] [rad/s].
  std::vector<float> linear;           ///< [T, B] driven during step t, [m/s].
  std::vector<float> angular;          ///< [T, B] [rad/s].
  std::vector<float> x, y;             ///< [T, B] after step t, in L, [m].
  std::vector<float> cosine, sine;     ///< [T, B] of the heading after step t.
  std::vector<float> start_rows;       ///< Scratch of `Drive`.
};

/// Drives all rollouts: speeds follow the controls as fast as `limits` allow; a step is an arc,
/// taken as its chord's direction times its length. Cost: 0.1 ms for 1000 rollouts of 56 steps.
/// Requires: |angular| * dt <= 1 for every control.
void Drive(const RolloutStart& start, const DriveLimits& limits, Rollouts& rollouts);

}  // namespace slalom::planners
