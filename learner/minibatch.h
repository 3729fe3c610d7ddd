#pragma once

#include <ATen/core/Tensor.h>

#include <memory>

#include "base/parallel.h"
#include "base/random.h"
#include "env/action.h"
#include "policy/nn/feature_map.h"
#include "replay/batch.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `A` numbers of an action, `P`
/// numbers that critics alone see (`LearnerConfig::privileged_critic`), or 0.

namespace slalom::learner {

/// The transitions of one update, on the device of the networks. Its memory stays in place from
/// batch to batch.
struct Minibatch {
  /// `batch`: B; `history`: H; `frame_size`: F; `action_size`: A; `privileged_size`: P.
  Minibatch(int batch, int history, int frame_size, at::Device device,
            int action_size = env::kActionSize, int privileged_size = 0);

  /// Input of the networks: a state, what critics alone see, and behind it room for an action, into
  /// which critics and models copy it.
  at::Tensor input;          ///< [B, H * F + P + A], s and room
  at::Tensor next_input;     ///< [B, H * F + P + A], s' and room
  at::Tensor features;       ///< [B, H * F], s, a view
  at::Tensor next_features;  ///< [B, H * F], s', a view
  /// What critics see, and the room behind it: all of `features`, or, if P > 0, the newest frame
  /// and the P numbers.
  at::Tensor critic_input;                ///< [B, H * F + A] or [B, F + P + A], a view
  at::Tensor next_critic_input;           ///< The same of s', a view
  at::Tensor critic_features;             ///< [B, H * F] or [B, F + P], a view
  at::Tensor next_critic_features;        ///< The same of s', a view
  at::Tensor room;                        ///< [B, A], behind s, a view
  at::Tensor next_room;                   ///< [B, A], behind s', a view
  at::Tensor actions;                     ///< [B, A], a
  at::Tensor reward;                      ///< [B], scaled n-step return
  at::Tensor cost;                        ///< [B], n-step cost
  at::Tensor discount;                    ///< [B], gamma^n, or 0 if the window terminated
  at::Tensor weight;                      ///< [B], importance weight; 1 if draws are uniform
  base::Random* dropout = nullptr;        ///< Draws the masks of networks that have dropout.
  base::ParallelFor* parallel = nullptr;  ///< Computes critics side by side; null: in turn.
};

/// Turns sampled rows into minibatches. Scans are pooled straight from the replay table's memory,
/// and only the pooled features move to the device.
class MinibatchReader {
 public:
  /// `mirror`: whether to replace each sample, with probability 1/2, by its mirror image.
  /// `discount_factor`: every discount is multiplied by it. `privileged_size`: P, numbers that end
  /// the state of a row and are no feature of it; 0 or env::kPrivilegedSize. Requires: mirroring
  /// only on courses.
  MinibatchReader(nn::FeatureMap features, int history, double reward_scale, bool mirror,
                  double discount_factor, int privileged_size = 0);

  /// Fills `minibatch`. Draws from `random` only if mirroring is on. Requires: rows of B samples
  /// and H frames. Allocates nothing on the CPU.
  void Read(const replay::SampledRows& rows, base::Random& random, Minibatch& minibatch);

 private:
  nn::FeatureMap features_;
  int history_;
  float reward_scale_;
  bool mirror_;
  float discount_factor_;
  int privileged_size_;
  std::unique_ptr<Minibatch> host_;  // Staging memory if the device is not the CPU.
};

}  // namespace slalom::learner
