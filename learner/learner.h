#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "learner/learner_stats.h"
#include "learner/method.h"
#include "policy/nn/model_shape.h"
#include "policy/nn/safetensors.h"
#include "policy/policy.h"
#include "replay/batch.h"

namespace slalom::learner {

/// Learns a policy from replayed transitions, by the algorithm that the config names and the parts
/// that it combines with (constraint, transition model, imagination). docs/algorithms.md maps the
/// papers' equations to functions. Thread-compatible: one owner.
class Learner {
 public:
  /// Draws initial weights and noise from `seed`; the actor starts from `first` if it is given
  /// (`learner.from`). Throws `base::Error` if the config cannot be met:
  /// no GPU, sectors that do not divide the beams, or sections that contradict each other.
  /// Requires: spec.distribution is `DistributionOf(method.learner)`, and spec.planning is
  /// `PlanningOf` of the method and a goal; the actor of `first` has the shape of the spec's.
  Learner(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed,
          const std::optional<policy::PolicySnapshot>& first = std::nullopt);
  ~Learner();

  /// Does one update; with imagination, it is several updates of the policy. Copies what it needs
  /// out of the rows. `progress`: the fraction of training that is done, in [0, 1], which sets the
  /// learning rates. On the CPU, nothing is allocated except by algorithms whose losses autograd
  /// differentiates (TQC), and views during imagination; a GPU is not waited for. Requires: one
  /// batch for each of `sample_specs()`, in their order.
  void Update(std::span<const replay::SampledRows> batches, double progress);

  /// The samples of an update: the algorithm's batch, then the model's if there is one.
  const std::vector<replay::SampleSpec>& sample_specs() const { return sample_specs_; }

  /// Returns the absolute TD errors |Q(s, a) - y| of the last batch, averaged over the critics,
  /// [B]. They are the samples' new priorities. Valid until the next `Update`. Waits for the
  /// device. Requires: learner.prioritized, and at least one update.
  std::span<const float> TdErrors();

  /// Updates a constraint's multiplier from recent training episodes: their mean sum of costs (NaN
  /// if unknown), and the number `finished` since the last call.
  void ObserveEpisodes(double mean_cost, std::int64_t finished);

  /// Returns the statistics since the last call and resets them. Waits for the device, so call it
  /// only once in many updates.
  LearnerStats ReadStats();

  /// Returns the transition model's error after a rollout of `kErrorSteps` steps with the actions
  /// that were really taken: the root mean squared error per feature
  /// (learner/prediction_error.h). NaN if there is no model, or no sample has a whole window. Waits
  /// for the device. Requires: windows sampled as `window_spec()` says.
  static constexpr int kErrorSteps = 5;
  double PredictionError(const replay::SampledRows& windows) const;
  replay::SampleSpec window_spec() const {
    return {.batch = 256, .history = spec_.network.history + kErrorSteps, .n_step = 1};
  }
  bool has_model() const { return method_.model.kind != nn::ModelKind::kNone; }

  /// Returns what is wrong with the training, in words for the user: weights that are not finite,
  /// or, in the last `ReadStats`, action values beyond the divergence limit. Empty while all is
  /// well. Waits for the device.
  std::optional<std::string> FindFault() const;
  bool healthy() const { return !FindFault(); }

  /// The policy as it acts in training.
  policy::PolicySnapshot Snapshot() const;
  /// The policy to ship: the averaged actor, or the same as `Snapshot` if averaging is off. The
  /// version of both is the number of updates done.
  policy::PolicySnapshot BestSnapshot() const;

  std::int64_t num_updates() const;
  std::string device() const;  ///< "cpu" or "cuda".

  /// Saves everything that an update depends on. After `LoadState`, updates continue bit for bit on
  /// the same kind of device.
  void SaveState(nn::TensorMap& tensors) const;
  /// Throws `base::Error` if a tensor is missing or of another size.
  void LoadState(const nn::TensorFile& file);

 private:
  struct Parts;

  /// Throws `base::Error` with LibTorch's message if LibTorch refuses an operation of the
  /// algorithm.
  void UpdateAlgorithm(double rate);

  const MethodConfig method_;
  const policy::PolicySpec spec_;
  const std::vector<replay::SampleSpec> sample_specs_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace slalom::learner
