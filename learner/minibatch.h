#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "env/action.h"
#include "policy/nn/feature_map.h"
#include "replay/batch.h"

/// Shapes: `B` batch, `H` frames of history, `F` features of a frame, `A` numbers of an action.

namespace slalom::learner {

/// Consecutive rows of a minibatch, which one thread at a time computes.
struct RowSlice {
  std::int64_t begin = 0;  ///< Its first row.
  std::int64_t size = 0;   ///< Number of its rows.
};

/// The transitions of one update, on the device of the networks. Its memory stays in place from
/// batch to batch.
struct Minibatch {
  /// `batch`: B; `history`: H; `frame_size`: F; `action_size`: A.
  Minibatch(int batch, int history, int frame_size, at::Device device,
            int action_size = env::kActionSize);

  /// Input of the networks: a state, and behind it room for an action, into which critics and
  /// models copy it.
  at::Tensor input;                       ///< [B, H * F + A], s and room
  at::Tensor next_input;                  ///< [B, H * F + A], s' and room
  at::Tensor features;                    ///< [B, H * F], s, a view
  at::Tensor next_features;               ///< [B, H * F], s', a view
  at::Tensor room;                        ///< [B, A], behind s, a view
  at::Tensor next_room;                   ///< [B, A], behind s', a view
  at::Tensor actions;                     ///< [B, A], a
  at::Tensor reward;                      ///< [B], scaled n-step return
  at::Tensor cost;                        ///< [B], n-step cost
  at::Tensor discount;                    ///< [B], gamma^n, or 0 if the window terminated
  at::Tensor weight;                      ///< [B], importance weight; 1 if draws are uniform
  base::Random* dropout = nullptr;        ///< Draws the masks of networks that have dropout.
  base::ParallelFor* parallel = nullptr;  ///< Threads that compute slices; null: no slices.

  /// All rows in one slice, or with `parallel` in a few of nearly equal size. They depend on B, not
  /// on the number of threads.
  std::vector<RowSlice> Slices() const;
};

/// Turns sampled rows into minibatches. Scans are pooled straight from the replay table's memory,
/// and only the pooled features move to the device.
class MinibatchReader {
 public:
  /// `mirror`: whether to replace each sample, with probability 1/2, by its mirror image.
  /// `discount_factor`: every discount is multiplied by it. Requires: mirroring only on courses.
  MinibatchReader(nn::FeatureMap features, int history, double reward_scale, bool mirror,
                  double discount_factor);

  /// Fills `minibatch`. Draws from `random` only if mirroring is on. Requires: rows of B samples
  /// and H frames. Uses the minibatch's threads. Allocates nothing on the CPU.
  void Read(const replay::SampledRows& rows, base::Random& random, Minibatch& minibatch);

 private:
  /// Fills `size` rows from `begin` on in host memory.
  void ReadSlice(const replay::SampledRows& rows, const RowSlice& slice, Minibatch& host) const;

  nn::FeatureMap features_;
  int history_;
  float reward_scale_;
  bool mirror_;
  float discount_factor_;
  std::vector<char> mirrored_;       // [B], whether a sample is replaced by its mirror image.
  std::unique_ptr<Minibatch> host_;  // Staging memory if the device is not the CPU.
};

}  // namespace slalom::learner
