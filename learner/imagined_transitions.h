#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/minibatch.h"
#include "policy/nn/safetensors.h"

/// Shapes: `C` capacity, `B` batch, `H` frames of history, `F` numbers of a frame.

namespace slalom::learner {

/// MBPO's model buffer: a ring of imagined one-step transitions, on the device of the networks.
///
/// A transition stores only the newest frame of its next state, as its state holds the others.
/// Thread-compatible. Memory: 4 (H + 1) F bytes per transition, allocated by the constructor.
class ImaginedTransitions {
 public:
  /// Takes its shapes from `minibatch`. With a capacity of 0, nothing may be added.
  ImaginedTransitions(std::int64_t capacity, int history, const Minibatch& minibatch);

  /// Appends the B transitions of a minibatch: features, actions, reward, discount, and the newest
  /// frame of next_features. Requires: capacity >= B.
  void Add(const Minibatch& minibatch);

  /// Draws transitions uniformly, with replacement, into the rows of `minibatch` from `begin` on.
  /// Their costs become 0 and their weights 1. Requires: size() > 0.
  void Sample(std::int64_t begin, base::Random& random, Minibatch& minibatch) const;

  std::int64_t size() const { return size_; }

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  std::int64_t capacity_;
  std::int64_t frame_size_ = 0;
  std::int64_t size_ = 0;
  std::int64_t next_ = 0;  // Row that is written next.
  at::Tensor features_;    // [C, H * F]
  at::Tensor frames_;      // [C, F]
  at::Tensor actions_;     // [C, 2]
  at::Tensor reward_;      // [C]
  at::Tensor discount_;    // [C]
};

}  // namespace slalom::learner
