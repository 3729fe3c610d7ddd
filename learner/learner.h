#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "learner/learner_config.h"
#include "learner/learner_stats.h"
#include "learner/model_config.h"
#include "policy/model_shape.h"
#include "policy/policy.h"
#include "policy/safetensors.h"
#include "replay/batch.h"

namespace slalom::learner {

/// What a run learns by: every section of its config that the learner reads.
struct MethodConfig {
  LearnerConfig learner;
  ConstraintConfig constraint;
  policy::TransitionModelConfig model;
  ModelTrainingConfig model_training;
  ImaginationConfig imagination;
};

/// What the policies of a method carry for agents that plan: part of every policy that it makes.
/// `goal`: when the task's episodes end in success.
policy::PlanningSpec PlanningOf(const MethodConfig& method, const policy::GoalRule& goal = {});

/// Learns a policy from replayed transitions, by the algorithm that the config names and what is
/// combined with it. docs/algorithms.md maps the papers' equations to functions.
/// Thread-compatible: one owner.
class Learner {
 public:
  /// Networks and noise are drawn from `seed`. Throws `base::Error` where the config cannot be met
  /// (no GPU, sectors that do not divide the beams, parts that do not go together).
  /// Requires: spec.distribution is `DistributionOf(method.learner)`, spec.planning `PlanningOf` of
  /// the method and a goal.
  Learner(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed);
  ~Learner();

  /// One update. Copies what it needs out of the rows. `progress`: part of training that is done,
  /// in [0, 1], for the learning rates. With imagination it is several updates of the policy. On
  /// the CPU: no allocation, but of views where it imagines; on a GPU: no wait for it. Requires:
  /// rows sampled as `sample_specs()` say, one batch of each.
  void Update(std::span<const replay::SampledRows> batches, double progress);

  /// What an update learns from: the algorithm's transitions, then those of a model.
  const std::vector<replay::SampleSpec>& sample_specs() const { return sample_specs_; }
  static std::vector<replay::SampleSpec> SampleSpecs(const MethodConfig& method,
                                                     const policy::PolicySpec& spec);

  /// The new priorities of the last batch's samples: |Q(s, a) - y|, mean of the critics, [B]. Valid
  /// until the next `Update`. Waits for the device. Requires: prioritized, one update.
  std::span<const float> TdErrors();

  /// What training episodes show lately, for a constraint: collisions per episode (NaN: not
  /// known) and episodes `finished` since the last call.
  void ObserveEpisodes(double collisions, std::int64_t finished);

  /// Reads the statistics and starts new ones. Waits for the device; call it once in many updates.
  LearnerStats ReadStats();

  /// How far the transition model is off after so many steps, each by the action really taken: the
  /// root of the mean squared error of a feature (learner/prediction_error.h). NaN where there is
  /// no model, or no sample has a whole window. Waits for the device. Requires: windows sampled as
  /// `window_spec()` says.
  static constexpr int kErrorSteps = 5;
  double PredictionError(const replay::SampledRows& windows) const;
  replay::SampleSpec window_spec() const {
    return {.batch = 256, .history = spec_.network.history + kErrorSteps, .n_step = 1};
  }
  bool has_model() const { return method_.model.kind != "none"; }

  /// What is wrong with the training, in words for the user: a network with NaN or infinite
  /// weights, or values beyond the limit. Empty while it is well. Waits for the device. Looks at
  /// the last `ReadStats`.
  std::optional<std::string> FindFault() const;
  bool healthy() const { return !FindFault(); }

  /// The policy as it acts in training.
  policy::PolicySnapshot Snapshot() const;
  /// The policy to ship: its weights' average, or `Snapshot` where averaging is off. Version:
  /// updates done.
  policy::PolicySnapshot BestSnapshot() const;

  std::int64_t num_updates() const;
  std::string device() const;  ///< "cpu" or "cuda".

  /// Everything that an update depends on: after `LoadState` of what `SaveState` gave, updates go
  /// on bit for bit on the same kind of device.
  void SaveState(policy::TensorMap& tensors) const;
  /// Throws `base::Error` where a tensor is missing or of another size.
  void LoadState(const policy::TensorFile& file);

 private:
  struct Parts;

  const MethodConfig method_;
  const policy::PolicySpec spec_;
  const std::vector<replay::SampleSpec> sample_specs_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace slalom::learner
