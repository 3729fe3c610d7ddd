#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

#include "base/random.h"
#include "learner/algorithm.h"
#include "learner/imagined_transitions.h"
#include "learner/minibatch.h"
#include "learner/model_config.h"
#include "learner/model_trainer.h"
#include "learner/noise.h"

/// Shapes: `B` batch of the learner, `H` frames of history, `F` numbers of a frame.

namespace slalom::learner {

/// Length of a rollout after so many updates of the policy: linear between the schedule's ends, and
/// rounded down (Janner et al. 2019, appendix C).
int RolloutSteps(const ImaginationConfig& config, std::int64_t num_updates);

/// States that imagination starts from for each replayed batch of `batch_size`.
/// Throws `base::Error` that names the key where the config contradicts itself.
int NumStartingStates(const ImaginationConfig& config, int batch_size);

/// Fills an algorithm's minibatch with what a transition model imagines: each step is the policy's
/// action with noise, then an elite network's prediction (with its own noise where probabilistic),
/// from which the next step goes on.
///
/// Dyna-style (Sutton 1990; docs/original-system.md, section 5.2): from state s, n steps are
/// imagined; reward = sum_i gamma^i alive_i r_i and discount = gamma^n alive_n, with alive the
/// probability that no step before terminated. MBPO (Janner et al. 2019, algorithm 2): one-step
/// transitions of rollouts go to a buffer, and batches are mixed from it and from replayed ones;
/// where a step terminates (drawn by its probability) the rollout starts again from its state.
/// Thread-compatible: one owner.
class Imagination {
 public:
  /// All references are kept. Requires: the algorithm finds its transitions in `minibatch`, and
  /// `trainer` loads at least `NumStartingStates` rows.
  Imagination(const ImaginationConfig& config, double gamma, const ModelTrainer& trainer,
              Algorithm& algorithm, Minibatch& minibatch, std::uint64_t seed);

  /// Whether the model has been trained enough.
  bool ready() const { return trainer_.num_updates() >= config_.learning_starts; }
  /// Whether the policy is updated from the replayed batch itself, too: in Dyna. MBPO mixes it in.
  bool adds_to_replayed() const { return config_.kind == "dyna"; }
  /// Batches that `Fill` makes for each replayed one: 0 .. num_batches() - 1.
  int num_batches() const { return config_.imagined_batches; }

  /// After the trainer has loaded its rows; for MBPO while the minibatch holds a replayed batch
  /// that the algorithm has not updated from: keeps it and imagines the rollouts. `num_updates`: of
  /// the policy.
  void Begin(std::int64_t num_updates);

  /// Fills the minibatch with batch `k`. Requires: `Begin`.
  void Fill(int k);

  void SaveState(policy::TensorMap& tensors) const;
  void LoadState(const policy::TensorFile& file);

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
  policy::ModelPass pass_;           // Reads minibatch.next_input and is rolled forward in it.
  Noise action_noise_;               // [B, 2]
  Noise model_noise_;                // [B, M]
  at::Tensor alive_;                 // [B]
  Minibatch real_;                   // MBPO: the replayed batch
  ImaginedTransitions transitions_;  // MBPO
};

}  // namespace slalom::learner
