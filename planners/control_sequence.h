#pragma once

#include <array>
#include <span>
#include <vector>

#include "planners/local_planner.h"
#include "planners/rollouts.h"

/// Shapes: `B` rollouts, `T` steps.

namespace slalom::planners {

/// Speeds to command during the coming T steps, and the last few commanded. A value.
struct ControlSequence {
  /// At rest. Requires: num_steps >= 1.
  explicit ControlSequence(int num_steps);

  /// At rest again, nothing commanded before.
  void Clear();

  /// Drops the first step, which has been commanded, and repeats the last.
  void Shift();

  std::vector<float> linear;       ///< [T] [m/s]
  std::vector<float> angular;      ///< [T] [rad/s]
  std::array<Twist, 4> commanded;  ///< Oldest first.
};

/// Softmax of the costs at `temperature`: weights[b] is proportional to exp(-(costs[b] - least) /
/// temperature), and all add up to 1. Requires: sizes equal, not empty, temperature > 0.
void SoftmaxOfCosts(std::span<const float> costs, double temperature, std::span<float> weights);

/// The information-theoretic term (Williams et al. 2018, as Nav2 has it): adds gamma / std^2 times
/// the sum over the steps of u * (sampled - u), of both controls. [B].
void AddControlCosts(const Rollouts& rollouts, const ControlSequence& sequence, double gamma,
                     double linear_std, double angular_std, std::span<float> costs);

/// Each step of `sequence` becomes the weighted mean of the sampled controls. weights: [B].
void TakeWeightedMean(const Rollouts& rollouts, std::span<const float> weights,
                      ControlSequence& sequence);

/// Savitzky-Golay filter, quadratic, over 9 steps: a step becomes the value at its place of the
/// parabola that fits it and its four neighbours on either side best. Before the first stand the
/// last commands, after the last its copies.
void Smooth(ControlSequence& sequence);

/// Limits speeds to [min_linear, max_linear] and +-max_angular, and their changes from step to
/// step, beginning with `now`, to those of `limits`.
void LimitControls(double min_linear, double max_linear, double max_angular,
                   const DriveLimits& limits, Twist now, ControlSequence& sequence);

}  // namespace slalom::planners
