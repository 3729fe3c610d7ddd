#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"
#include "learner/adam.h"
#include "learner/learner_stats.h"
#include "learner/method.h"
#include "learner/minibatch.h"
#include "learner/model_loss.h"
#include "policy/nn/transition_model.h"
#include "replay/batch.h"

/// Shapes: `B` batch, `U` updates per load, `E` members of the ensemble, `P` parameters of one.

namespace slalom::learner {

/// Trains a transition model from replayed one-step transitions.
///
/// Whether a transition is held out depends only on its sequence number in the replay table, so it
/// never changes sides. In an ensemble, a transition's weight for a member is a Poisson number with
/// mean 1, derived from transition and member (online bootstrap, Oza and Russell 2001). So members
/// learn from different data, though they share batches. Thread-compatible: one owner.
class ModelTrainer {
 public:
  /// Draws weights and mirroring from `seed`. `num_rows`: the least number of rows that `Load`
  /// takes, for callers (imagination) that need more rows than training does.
  ModelTrainer(const ModelTrainingConfig& config, const nn::ModelShape& shape,
               const nn::FeatureMap& features, double reward_scale, bool mirror, at::Device device,
               std::uint64_t seed, int num_rows = 0);

  /// The samples that `Load` needs: U * B one-step transitions, or `num_rows` if that is more.
  replay::SampleSpec sample_spec() const { return ModelSample(config_, history_, num_rows_); }

  /// Copies the transitions out of the rows. Requires: rows sampled as `sample_spec()` says.
  void Load(const replay::SampledRows& rows);

  /// Does U updates of every member from the loaded transitions. Allocates memory and waits for a
  /// GPU only when it chooses new elites.
  void Update();

  /// The transitions that were loaded.
  const Minibatch& loaded() const { return loaded_; }
  const nn::TransitionModel& model() const { return model_; }
  const at::Tensor& parameters() const { return parameters_; }  ///< [E * P]
  /// The `NumElites` members that predict, best first, as last chosen; at first members 0, 1, ...
  std::span<const int> elites() const { return elites_; }
  /// The parameters of the elites alone, best first, in host memory.
  std::vector<float> EliteParameters() const;

  /// Returns the statistics since the last call and resets them. Waits for the device.
  ModelStats ReadStats();
  std::int64_t num_updates() const { return num_updates_; }
  bool is_finite() const;

  void SaveState(nn::TensorMap& tensors) const;
  void LoadState(const nn::TensorFile& file);

 private:
  void ChooseElites();

  const ModelTrainingConfig config_;
  const nn::ModelShape shape_;
  const int num_rows_;
  const int history_;
  base::Random mirror_;
  std::uint64_t bootstrap_seed_;  // Part of the state, so that the held-out rows stay the same.
  MinibatchReader reader_;
  Minibatch loaded_;
  at::Tensor parameters_;
  at::Tensor gradient_;
  nn::TransitionModel model_;
  nn::TransitionModel gradient_model_;
  std::vector<Adam> adam_;                 // [E], each with its own count of steps
  std::vector<at::Tensor> member_values_;  // [E], views [P]
  std::vector<nn::ModelPass> passes_;      // [U]
  std::vector<ModelTargets> targets_;      // [U], without weights
  at::Tensor host_weights_;                // [E, U * B]
  at::Tensor weights_;
  std::vector<at::Tensor> weight_views_;  // [E * U], [B] each
  at::Tensor figures_;                    // [E, kNumModelFigures] float64, since the beginning
  at::Tensor norm_total_;                 // [1] float64
  std::vector<at::Tensor> figure_rows_;
  at::Tensor figures_at_choice_;   // As `figures_`, in host memory, at the last choice of elites
  at::Tensor figures_at_reading_;  // [kNumModelFigures + 1], sums over members, and of the norms
  std::vector<int> elites_;
  std::int64_t num_updates_ = 0;
  std::int64_t updates_at_reading_ = 0;
};

}  // namespace slalom::learner
