#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/minibatch.h"
#include "policy/safetensors.h"

/// Shapes: `C` capacity, `B` batch, `H` frames of history, `F` numbers of a frame.

namespace slalom::learner {

/// MBPO's model buffer: a ring of imagined one-step transitions, where the networks compute.
///
/// The frame after a transition is kept alone, as the stack before it holds the rest.
/// Thread-compatible. Memory: 4 (H + 1) F bytes a transition, taken at once.
class ImaginedTransitions {
 public:
  /// Of the shapes of `minibatch`. A capacity of 0 makes a ring that nothing may be added to.
  ImaginedTransitions(std::int64_t capacity, int history, const Minibatch& minibatch);

  /// Appends the B transitions of a minibatch: features, actions, reward, discount, and the newest
  /// frame of next_features. Requires: capacity >= B.
  void Add(const Minibatch& minibatch);

  /// Draws transitions uniformly, with replacement, into rows `begin` and on of `minibatch`; costs
  /// become 0 and weights 1. Requires: size() > 0.
  void Sample(std::int64_t begin, base::Random& random, Minibatch& minibatch) const;

  std::int64_t size() const { return size_; }

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

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
