#pragma once

#include <array>
#include <span>
#include <vector>

#include "planners/mppi/rollouts.h"
#include "planners/navigation/local_planner.h"

/// Shapes: `B` rollouts, `T` steps.

namespace slalom::planners {

/// The speeds to command in the next T steps, and the last few commands. A value.
struct ControlSequence {
  /// Makes a sequence at rest. Requires: num_steps >= 1.
  explicit ControlSequence(int num_steps);

  /// Resets everything to rest.
  void Clear();

  /// Drops the first step, which has been commanded, and repeats the last.
  void Shift();

  std::vector<float> linear;       ///< [T] [m/s]
  std::vector<float> angular;      ///< [T] [rad/s]
  std::array<Twist, 4> commanded;  ///< Oldest first.
};

/// Computes the softmax of the negative costs at `temperature`: weights[b] is proportional to
/// exp(-(costs[b] - least) / temperature), and all add up to 1. Requires: sizes equal, not empty,
/// temperature > 0.
void SoftmaxOfCosts(std::span<const float> costs, double temperature, std::span<float> weights);

/// Adds the information-theoretic cost (Williams et al. 2018, as in Nav2) to `costs` [B]: gamma /
/// std^2 times the sum over the steps of u * (sampled - u), for both controls.
void AddControlCosts(const Rollouts& rollouts, const ControlSequence& sequence, double gamma,
                     double linear_std, double angular_std, std::span<float> costs);

/// Sets each step of `sequence` to the weighted mean of the sampled controls. weights: [B].
void TakeWeightedMean(const Rollouts& rollouts, std::span<const float> weights,
                      ControlSequence& sequence);

/// Smooths with a quadratic Savitzky-Golay filter over 9 steps: each step becomes the value of the
/// parabola that best fits it and its four neighbours on either side. The sequence is padded with
/// the last commands in front and copies of its last step behind.
void Smooth(ControlSequence& sequence);

/// Limits speeds to [min_linear, max_linear] and +-max_angular, and their changes from step to
/// step, starting from `now`, to `limits`.
void LimitControls(double min_linear, double max_linear, double max_angular,
                   const DriveLimits& limits, Twist now, ControlSequence& sequence);

}  // namespace slalom::planners
