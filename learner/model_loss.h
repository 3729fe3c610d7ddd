#pragma once

#include <ATen/core/Tensor.h>

#include "policy/transition_model.h"

/// Shapes: `B` batch, `H` frames of history, `F` numbers of a frame, `M` <= F of them predicted.

namespace slalom::learner {

/// What a transition model is to have predicted. Views of a batch of one-step transitions.
struct ModelTargets {
  at::Tensor features;       ///< [B, H * F], the stack that was read
  at::Tensor next_features;  ///< [B, H * F], after the action; its newest frame is the target
  at::Tensor reward;         ///< [B], scaled
  at::Tensor discount;       ///< [B], 0 where the episode terminated
  at::Tensor cost;           ///< [B], above 0 where it did so by a collision
  at::Tensor weight;         ///< [B], what a transition counts in the loss; 0: held out
};

/// Sums over batches, by their place in a float64 tensor [kNumModelFigures] where the networks
/// compute.
enum ModelFigure {
  // Of transitions that are learned from, before the step.
  kModelStateLoss,
  kModelRewardLoss,
  kModelTerminationLoss,
  kModelWeight,  ///< Sum of the weights that the three above are to be divided by.
  // Of those held out.
  kHeldOutSquares,      ///< Mean over the M numbers of (target - mean)^2.
  kHeldOutChange,       ///< The same had the newest frame been taken for the next.
  kHeldOutLikelihood,   ///< Mean over the M numbers of the negative log-likelihood.
  kHeldOutReward,       ///< Squared error of the reward.
  kHeldOutTermination,  ///< Cross-entropy of termination.
  kHeldOutInside50,     ///< Part of the M numbers in the middle 50 % of what was predicted.
  kHeldOutInside90,
  kHeldOutCount,
  kNumModelFigures
};

/// The loss of a transition model, and its gradient by what the network gave:
///
///     sum_i w_i (c S_i + (r_i - r^_i)^2 + H(d_i, p_i)) / sum_i w_i
///
/// Where the shape knows success, a transition that ended in it counts as r_i less its reward and
/// d_i = 0: that is what the heads are to give.
///
/// with S_i the sum over the M numbers of the squared error, or of the Gaussian negative
/// log-likelihood ln sigma + z^2 / 2 + ln(2 pi) / 2 where probabilistic, c = `state_scale`, and H
/// the binary cross-entropy (docs/original-system.md, section 5.1).
///
/// Reads pass.output() and pass.log_std() as `TransitionModel::Forward` left them and writes
/// pass.output_gradient(). Adds to `figures`. Figures of deterministic models hold no likelihood
/// and no intervals. In float32 on the CPU: no allocation.
void ModelLoss(const policy::ModelShape& shape, const ModelTargets& targets, double state_scale,
               policy::ModelPass& pass, at::Tensor& figures);

}  // namespace slalom::learner
