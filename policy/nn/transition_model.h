#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/nn/model_shape.h"
#include "policy/nn/network.h"

/// Shapes: `B` batch, `H` frames of history, `F` numbers of a frame, `M` <= F of them predicted,
/// `A` = 2 numbers of an action, `O` outputs, `P` parameters of one member.

namespace slalom::nn {

/// `ModelShape::IsSuccess` of `frames` [B, F], as 0 and 1 of their type. On any device.
at::Tensor AreSuccesses(const ModelShape& shape, const at::Tensor& frames);

/// What a pass through a `TransitionModel` reads and leaves behind, for one batch size. Allocates
/// on construction only. Confined to one thread at a time.
class ModelPass {
 public:
  /// `input`: [B, H * F + A], stacks of frames with the actions taken behind them; kept, not
  /// copied.
  ModelPass(const ModelShape& shape, const at::Tensor& input, PassUse use = PassUse::kTraining);

  at::Tensor& output() { return network_.output(); }                    ///< [B, O], raw.
  at::Tensor& output_gradient() { return network_.output_gradient(); }  ///< [B, O]
  NetworkPass& network() { return network_; }

  /// Written by `TransitionModel::Forward`, where probabilistic: [B, M].
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

/// Predicts what follows a stack of frames and an action: the next frame in the features that the
/// networks see, the reward (scaled as the learner's) and the probability that the episode
/// terminates, by any one of the networks of an ensemble.
///
/// What the next frame's last action is, is known, and filled in unless the config says otherwise.
/// Where the shape knows success, a next frame in the goal's radius ends the episode with its
/// reward; the network then gives the reward without it, and the probability of any other end.
/// Thread-compatible; `Predict` into different passes is thread-safe.
class TransitionModel {
 public:
  /// `parameters`: [ensemble * P], shared, not copied.
  TransitionModel(const ModelShape& shape, const at::Tensor& parameters);

  /// Computes pass.output() from the pass's input: with tanh on the ranges' means where the shape
  /// bounds them, else raw, and pass.log_std(): min + (max - min) (1 + tanh raw) / 2 in columns
  /// with bounds, raw in the others. On the CPU: no allocation.
  void Forward(ModelPass& pass, int member) const;

  /// `Forward`, then writes pass.reward(), pass.termination() and the stacks of frames after the
  /// action to `next`, [B, H * F] (its rows may lie in wider ones), which may be the columns of the
  /// pass's input itself: so a model is rolled forward in place.
  ///
  /// `noise`: [B, M] standard normal, that a probabilistic model's standard deviations scale;
  /// undefined: its means. Requires: 0 <= member < ensemble.
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
