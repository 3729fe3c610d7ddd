#pragma once

#include <ATen/core/Tensor.h>

#include <memory>

#include "base/random.h"
#include "policy/feature_map.h"
#include "replay/batch.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `A` = 2 numbers of an action.

namespace slalom::learner {

/// What one update learns from, where the networks compute. Its memory stays in place from batch to
/// batch.
struct Minibatch {
  /// `history` H, `frame_size` F.
  Minibatch(int batch, int history, int frame_size, at::Device device);

  /// Critics read both parts of an input, actors the first.
  at::Tensor input;       ///< [B, H * F + A], s and a
  at::Tensor next_input;  ///< [B, H * F + A], s' and room for the action that a target takes there
  at::Tensor features;    ///< [B, H * F], s, a view
  at::Tensor next_features;         ///< [B, H * F], s', a view
  at::Tensor actions;               ///< [B, A], a, a view
  at::Tensor next_actions;          ///< [B, A], a view
  at::Tensor reward;                ///< [B], scaled n-step return
  at::Tensor cost;                  ///< [B], n-step cost
  at::Tensor discount;              ///< [B], gamma^n, or 0 where the window terminated
  at::Tensor weight;                ///< [B], importance of the sample, 1 where draws are uniform
  base::Random* dropout = nullptr;  ///< Draws the masks of networks that have dropout.
};

/// Turns sampled rows into minibatches: scans are pooled straight from where the replay table keeps
/// them, and numbers move to the device once.
class MinibatchReader {
 public:
  /// `mirror`: every sample is, with probability 1/2, replaced by its mirror image.
  /// `discount_factor`: what every discount is multiplied by.
  MinibatchReader(policy::FeatureMap features, int history, double reward_scale, bool mirror,
                  double discount_factor);

  /// Fills `minibatch`. `random` is drawn from where mirroring is on. Requires: rows of B samples
  /// and H frames. Cost on the CPU: no allocation.
  void Read(const replay::SampledRows& rows, base::Random& random, Minibatch& minibatch);

 private:
  policy::FeatureMap features_;
  int history_;
  float reward_scale_;
  bool mirror_;
  float discount_factor_;
  std::unique_ptr<Minibatch> host_;  // Where another device needs one.
};

}  // namespace slalom::learner
