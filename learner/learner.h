#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "learner/learner_config.h"
#include "learner/learner_stats.h"
#include "policy/policy.h"
#include "policy/safetensors.h"
#include "replay/batch.h"

namespace slalom::learner {

/// What a run learns by: every section of its config that the learner reads.
struct MethodConfig {
  LearnerConfig learner;
  ConstraintConfig constraint;
};

/// Learns a policy from replayed transitions, by the algorithm that the config names and what is
/// combined with it. docs/algorithms.md maps the papers' equations to functions.
/// Thread-compatible: one owner.
class Learner {
 public:
  /// Networks and noise are drawn from `seed`. Throws `base::Error` where the config cannot be met
  /// (no GPU, sectors that do not divide the beams, parts that do not go together).
  /// Requires: spec.distribution is `DistributionOf(method.learner)`.
  Learner(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed);
  ~Learner();

  /// One update. Copies what it needs out of the rows. `progress`: part of training that is done,
  /// in [0, 1], for the learning rates. On the CPU: no allocation; on a GPU: no wait for it.
  /// Requires: rows sampled as `sample_specs()` say, one batch of each.
  void Update(std::span<const replay::SampledRows> batches, double progress);

  /// What an update learns from: the algorithm's transitions.
  std::vector<replay::SampleSpec> sample_specs() const { return SampleSpecs(method_, spec_); }
  static std::vector<replay::SampleSpec> SampleSpecs(const MethodConfig& method,
                                                     const policy::PolicySpec& spec);

  /// The new priorities of the last batch's samples: |Q(s, a) - y|, mean of the critics, [B]. Valid
  /// until the next `Update`. Waits for the device. Requires: prioritized, one update.
  std::span<const float> Errors();

  /// What training episodes show lately, for a constraint: collisions per episode (NaN: not
  /// known) and episodes finished in all.
  void ObserveEpisodes(double collisions, std::int64_t num_episodes);

  /// Reads the statistics and starts new ones. Waits for the device; call it once in many updates.
  LearnerStats ReadStats();

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
  std::unique_ptr<Parts> parts_;
};

}  // namespace slalom::learner
