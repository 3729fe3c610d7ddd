#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/nn/model_shape.h"
#include "policy/nn/network.h"

/// Shapes: `B` batch, `H` frames of history, `F` numbers of a frame, `M` <= F of them predicted,
/// `A` numbers of an action, `O` outputs, `P` parameters of one member.

namespace slalom::nn {

/// Computes `ModelShape::IsSuccess` of `frames` [B, F] as 0 and 1 of their type, on any device.
at::Tensor AreSuccesses(const ModelShape& shape, const at::Tensor& frames);

/// Inputs, outputs and intermediate results of a pass through a `TransitionModel`, for one batch
/// size. Allocates on construction only. Confined to one thread at a time.
class ModelPass {
 public:
  /// `input`: [B, H * F + A], stacks of frames with the actions taken behind them; kept, not
  /// copied.
  ModelPass(const ModelShape& shape, const at::Tensor& input, PassUse use = PassUse::kTraining);

  at::Tensor& output() { return network_.output(); }                    ///< [B, O], raw.
  at::Tensor& output_gradient() { return network_.output_gradient(); }  ///< [B, O]
  NetworkPass& network() { return network_; }

  /// [B, M], written by `TransitionModel::Forward` if probabilistic.
  const at::Tensor& log_std() const { return log_std_; }

  /// Written by `TransitionModel::Predict`.
  const at::Tensor& reward() const { return reward_; }            ///< [B]
  const at::Tensor& termination() const { return termination_; }  ///< [B], probability.

 private:
  friend class TransitionModel;

  at::Tensor input_;
  NetworkPass network_;
  at::Tensor log_std_;  // [B, M]
  at::Tensor reward_;
  at::Tensor termination_;
};

/// Predicts the outcome of an action after a stack of frames: the next frame in the features that
/// the networks see, the reward (scaled as the learner's) and the probability that the episode
/// terminates, by any one of the networks of an ensemble.
///
/// The next frame's last action is known, and filled in unless the config says otherwise. If the
/// shape knows success, a next frame within the goal's radius ends the episode with the reward of
/// the goal; the network then gives the reward without it, and the probability of any other end.
/// Thread-compatible; `Predict` into different passes is thread-safe.
class TransitionModel {
 public:
  /// `parameters`: [ensemble * P], shared, not copied.
  TransitionModel(const ModelShape& shape, const at::Tensor& parameters);

  /// Computes pass.output() from the pass's input: with tanh on the ranges' means if the shape
  /// bounds them, else raw, and pass.log_std(): min + (max - min) (1 + tanh raw) / 2 in columns
  /// with bounds, raw in the others. On the CPU: no allocation.
  void Forward(ModelPass& pass, int member) const;

  /// Calls `Forward`, then writes pass.reward(), pass.termination() and, to `next`, the stacks of
  /// frames after the action, [B, H * F] (its rows may lie in wider ones). `next` may be columns of
  /// the pass's input itself, so that a model is rolled forward in place.
  ///
  /// `noise`: [B, M] standard normal numbers, which a probabilistic model's standard deviations
  /// scale. If it is undefined, the means are predicted. Requires: 0 <= member < ensemble.
  /// On the CPU in float32: no allocation.
  void Predict(ModelPass& pass, int member, const at::Tensor& noise, at::Tensor& next) const;

  const ModelShape& shape() const { return shape_; }
  const Network& member(int i) const { return members_[i]; }
  Network& member(int i) { return members_[i]; }

 private:
  ModelShape shape_;
  std::vector<Network> members_;
};

}  // namespace slalom::nn
