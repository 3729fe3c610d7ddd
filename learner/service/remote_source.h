#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "learner/loop/batch_source.h"
#include "learner/service/actor_figures.h"
#include "learner/service/batch_stream.h"
#include "learner/service/policy_server.h"
#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"

namespace slalom::learner {

/// The metrics of a stream of batches from a replay server. Confined to one thread.
class StreamMetrics {
 public:
  explicit StreamMetrics(metrics::Registry& registry);

  void AddBatch();
  /// Adds time spent waiting for batches. After 10 s without a batch, this becomes the registry's
  /// fault, which the health check shows, until a batch comes.
  void AddWait(double seconds);
  void SetStream(int in_flight, double policy_lag, int connections);

 private:
  metrics::Registry& registry_;
  metrics::Counter batches_;
  metrics::Counter waited_;
  double waiting_s_ = 0.0;  ///< Since the last batch.
};

/// A source of batches from a replay server, to which it also sends the learner's reports.
class RemoteSource final : public BatchSource {
 public:
  /// Connects at `Start`. Keeps references to `context`, `policies` and `registry`, which must
  /// outlive it. `prefetch`: as for `BatchStream`.
  RemoteSource(transport::Context& context, transport::ClientOptions replay, proto::Hello hello,
               const env::StepShape& shape, std::vector<replay::SampleSpec> specs, int prefetch,
               const PolicyServer& policies, metrics::Registry& registry);

  void Start() override;
  void Stop() override {}
  const std::vector<replay::SampledRows>* Next() override;
  bool IsWaiting() const override { return waiting_; }
  bool IsAtRest() const override { return true; }
  std::int64_t num_drawn() const override;
  std::int64_t steps() const override { return steps_; }
  EndedEpisodes TakeEndedEpisodes() override;
  void SetPriorities(std::span<const std::int64_t> sequence,
                     std::span<const float> priority) override;
  const replay::SampledRows* SampleForFigures(const replay::SampleSpec& spec) override;
  void Describe(run::MetricsRow& row) override;
  void Report(const run::MetricsRow& row, double seconds_left, bool finished) override;
  void Save(const std::filesystem::path& checkpoint, nlohmann::json& state) override;
  void Restore(const std::filesystem::path& checkpoint, const nlohmann::json& state) override;
  void KeepOnly(const std::vector<std::filesystem::path>&) override {}

  /// Keeps the connection alive when no more batches are wanted. Requires: `Start` was called.
  void Idle();

 private:
  void Say(const std::string& what);

  transport::Context& context_;
  const transport::ClientOptions replay_;
  const proto::Hello hello_;
  const env::StepShape shape_;
  const std::vector<replay::SampleSpec> specs_;
  const int prefetch_;
  const PolicyServer& policies_;
  StreamMetrics metrics_;
  FinishedEpisodes finished_episodes_;
  std::unique_ptr<BatchStream> stream_;  // Made with the cursor of the checkpoint.

  std::uint64_t cursor_ = 0;  // Restored.
  bool waiting_ = true;
  double waited_s_ = 0.0;  // Since the last report.
  std::int64_t steps_ = 0;
  std::int64_t table_steps_ = 0;
  double acting_version_ = 0.0;
  EndedEpisodes ended_;
  std::string said_;
};

}  // namespace slalom::learner
