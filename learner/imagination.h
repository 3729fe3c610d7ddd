#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/algorithm.h"
#include "learner/minibatch.h"
#include "learner/model_config.h"
#include "learner/model_trainer.h"
#include "learner/noise.h"
#include "policy/nn/safetensors.h"

/// Shapes: `B` batch of the learner, `H` frames of history, `F` numbers of a frame.

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

/// Returns the length of a model rollout after `num_updates` updates of the policy. It is linear
/// between the ends of the schedule and rounded down (Janner et al. 2019, appendix C).
int RolloutSteps(const ImaginationConfig& config, std::int64_t num_updates);

/// Fills an algorithm's minibatch with imagined transitions, which are model rollouts: in each
/// step, the policy chooses an action, noise is added, and one of the ensemble's elite members
/// predicts the next state (a probabilistic model draws it), from which the next step continues.
///
/// Dyna (Sutton 1990; docs/original-system.md, section 5.2) imagines n steps from each state s. The
/// transition has reward = sum_i gamma^i alive_i r_i and discount = gamma^n alive_n, where alive_i
/// is the probability that no earlier step terminated. MBPO (Janner et al. 2019, algorithm 2)
/// stores the one-step transitions of its rollouts in a buffer and mixes batches from the buffer
/// and from replayed transitions. If a step terminates (drawn by its probability), that rollout
/// starts again from its first state. Thread-compatible: one owner.
class Imagination {
 public:
  /// Keeps all references. Requires: `algorithm` updates from `minibatch`, and `trainer` loads at
  /// least `NumStartingStates` rows.
  Imagination(const ImaginationConfig& config, double gamma, const ModelTrainer& trainer,
              Algorithm& algorithm, Minibatch& minibatch, std::uint64_t seed);

  /// Whether the model has been trained enough.
  bool ready() const { return trainer_.num_updates() >= config_.learning_starts; }
  /// Whether the policy is updated from the replayed batch itself, too. Dyna does so; MBPO mixes
  /// replayed transitions into its batches instead.
  bool adds_to_replayed() const { return config_.kind == ImaginationKind::kDyna; }
  /// Number of batches that `Fill` makes for each replayed one.
  int num_batches() const { return config_.imagined_batches; }

  /// Starts a round of batches, once the trainer has loaded its rows. MBPO keeps a copy of the
  /// replayed batch in the minibatch, which the algorithm must not have updated from, and imagines
  /// its rollouts. `num_updates` counts the policy's updates.
  void Begin(std::int64_t num_updates);

  /// Fills the minibatch with batch `k`, 0 <= k < num_batches(). Requires: `Begin` was called.
  void Fill(int k);

  /// Number of transitions imagined since the beginning: one for each state and step of a rollout.
  std::int64_t num_transitions() const { return num_transitions_; }

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  void StartFrom(std::int64_t row);
  void Step(bool clip);
  void FillDyna(int k);
  void FillAsPublished(int k);
  void RollOut(std::int64_t row, int steps);

  const ImaginationConfig config_;
  const double gamma_;
  const ModelTrainer& trainer_;
  Algorithm& algorithm_;
  Minibatch& minibatch_;
  base::Random random_;
  std::int64_t num_transitions_ = 0;
  nn::ModelPass pass_;               // Reads minibatch.next_input and is rolled forward in it.
  Noise action_noise_;               // [B, 2]
  Noise model_noise_;                // [B, M]
  at::Tensor alive_;                 // [B]
  Minibatch real_;                   // MBPO: the replayed batch
  ImaginedTransitions transitions_;  // MBPO
};

}  // namespace slalom::learner
