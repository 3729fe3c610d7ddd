#pragma once

#include <ATen/core/Tensor.h>

#include "policy/nn/transition_model.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `M` <= F of them predicted.

namespace slalom::learner {

/// The targets that a transition model is trained on: views of a batch of one-step transitions.
struct ModelTargets {
  at::Tensor features;       ///< [B, H * F], the model's input
  at::Tensor next_features;  ///< [B, H * F], after the action; the newest frame is the target
  at::Tensor reward;         ///< [B], scaled
  at::Tensor discount;       ///< [B], 0 if the episode terminated
  at::Tensor cost;           ///< [B], above 0 if it terminated by a collision
  at::Tensor weight;         ///< [B], the transition's weight in the loss; 0 if held out
};

/// Sums over batches: indices into a float64 tensor [kNumModelFigures] on the networks' device.
enum ModelFigure {
  // Over the training transitions, before the gradient step.
  kModelStateLoss,
  kModelRewardLoss,
  kModelTerminationLoss,
  kModelWeight,  ///< Sum of the weights, by which the three sums above are divided.
  // Over the held-out transitions.
  kHeldOutSquares,      ///< Mean over the M features of (target - mean)^2.
  kHeldOutChange,       ///< The same for predicting that the newest frame repeats.
  kHeldOutLikelihood,   ///< Mean over the M features of the negative log-likelihood.
  kHeldOutReward,       ///< Squared error of the reward.
  kHeldOutTermination,  ///< Cross-entropy of termination.
  kHeldOutInside50,     ///< Fraction of the M features in the middle 50 % of the prediction.
  kHeldOutInside90,
  kHeldOutCount,
  kNumModelFigures
};

/// Computes the loss of a transition model and its gradient with respect to the network's output:
///
///     sum_i w_i (c S_i + (r_i - r^_i)^2 + H(d_i, p_i)) / sum_i w_i
///
/// Here S_i is the sum over the M features of the squared error or, for a probabilistic model, of
/// the Gaussian negative log-likelihood ln sigma + z^2 / 2 + ln(2 pi) / 2; c = `state_scale`; and H
/// is the binary cross-entropy (docs/original-system.md, section 5.1). If the shape knows when an
/// episode succeeds, the heads do not predict success: the target of a transition that ended in
/// success is its reward without the reward for success, and d_i = 0.
///
/// Reads pass.output() and pass.log_std() as `TransitionModel::Forward` left them and writes
/// pass.output_gradient(). Adds to `figures`; a deterministic model adds neither likelihood nor
/// intervals. Allocates nothing for float32 on the CPU.
void ModelLoss(const nn::ModelShape& shape, const ModelTargets& targets, double state_scale,
               nn::ModelPass& pass, at::Tensor& figures);

}  // namespace slalom::learner
