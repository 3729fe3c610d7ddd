#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "actor/actor.h"
#include "app/train/collector.h"
#include "app/train/run_config.h"
#include "base/random.h"
#include "learner/loop/batch_source.h"
#include "learner/loop/policy_sink.h"
#include "metrics/registry.h"
#include "policy/policy_agent.h"
#include "replay/rate_limiter.h"
#include "replay/storage.h"
#include "replay/table.h"

namespace slalom::train {

/// Draws batches from a table in this process. An actor of this process fills the table and gets
/// the policies. It replaces the replay server, actor and policy server of a service. It takes the
/// actor's chunks as the next update needs them, so no lock is held while sampling. In a
/// deterministic run, actor and learner take turns. Confined to the learner's thread.
class TableSource final : public learner::BatchSource, public learner::PolicySink {
 public:
  /// Saves the table below the directory `checkpoints`, which it makes. `specs`: the specs of the
  /// learner's batches. Keeps references to `actor`, `agent`, `table` and `registry`, which must
  /// outlive it. Throws `base::Error` if the directory cannot be made.
  TableSource(const RunConfig& config, std::vector<replay::SampleSpec> specs, actor::Actor& actor,
              policy::PolicyAgent& agent, replay::Table& table,
              const std::filesystem::path& checkpoints, metrics::Registry& registry);

  void Start() override;
  void Stop() override;
  const std::vector<replay::SampledRows>* Next() override;
  bool IsWaiting() const override { return false; }
  bool IsAtRest() const override;
  std::int64_t num_drawn() const override { return static_cast<std::int64_t>(limiter_->granted()); }
  std::int64_t steps() const override { return limiter_->steps(); }
  learner::EndedEpisodes TakeEndedEpisodes() override;
  void SetPriorities(std::span<const std::int64_t> sequence,
                     std::span<const float> priority) override;
  const replay::SampledRows* SampleForFigures(const replay::SampleSpec& spec) override;
  void Describe(run::MetricsRow& row) override;
  void Report(const run::MetricsRow& row, double seconds_left, bool finished) override;
  void Save(const std::filesystem::path& checkpoint, nlohmann::json& state) override;
  void Restore(const std::filesystem::path& checkpoint, const nlohmann::json& state) override;
  void KeepOnly(const std::vector<std::filesystem::path>& checkpoints) override;
  /// Deletes the saved table of every checkpoint. No `Save` may follow.
  void DeleteSaved() { storage_.DeleteAll(); }

  void Publish(policy::PolicySnapshot acting, learner::ShippedPolicy, std::int64_t) override;

 private:
  void Insert(std::unique_ptr<replay::Chunk> chunk);
  void ResetLimiter(std::int64_t steps, std::int64_t updates);
  void RestorePriorities(const std::filesystem::path& file);

  const RunConfig config_;
  const std::vector<replay::SampleSpec> specs_;
  actor::Actor& actor_;
  policy::PolicyAgent& agent_;
  replay::Table& table_;
  replay::Storage storage_;
  metrics::Registry& registry_;
  metrics::Counter batches_;
  metrics::Counter waited_;
  std::unique_ptr<Collector> collector_;  // Null if stopped.

  std::optional<replay::RateLimiter> limiter_;  // Its cursor counts updates.
  std::vector<replay::SampledRows> rows_;       // One of each kind.
  base::Random sampling_;
  base::Random diagnostics_;  // Serves figures only.
  replay::SampledRows windows_;
  std::int64_t observed_episodes_ = 0;
};

}  // namespace slalom::train
