#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "learner/loop/batch_source.h"
#include "learner/service/actor_figures.h"
#include "learner/service/policy_server.h"
#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/replay_link.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "replay/batch.h"

namespace slalom::learner {

/// The batches of one update as the replay server sent them, one of each kind. The scans stay in
/// the messages.
struct RemoteBatches {
  proto::SampleReply header;               ///< The header of the last one.
  std::vector<transport::Frame> payloads;  ///< [K]
  std::vector<replay::SampledRows> rows;   ///< [K], pointing into `payloads`.
};

/// Fetches the batches of a run in order, several ahead. If the connection breaks, batch k is
/// requested again until it has come; no other takes its place. With K kinds of batches, batch k is
/// of kind k mod K. Confined to one thread; ZeroMQ's own thread receives meanwhile.
class BatchStream {
 public:
  /// Begins at batch `cursor`, a multiple of specs.size(). `prefetch`: number of updates whose
  /// batches are requested ahead.
  BatchStream(transport::Context& context, const transport::ClientOptions& replay,
              proto::Hello hello, const env::StepShape& shape,
              std::vector<replay::SampleSpec> specs, int prefetch, std::uint64_t cursor);

  /// Returns the next batch of each kind, valid until the next call, or null if they have not come
  /// within `timeout`. Throws `base::Error` if the server refuses this learner for good or sends a
  /// malformed batch.
  const RemoteBatches* Next(std::chrono::milliseconds timeout);

  /// The number of the next batch, which a checkpoint keeps.
  std::uint64_t cursor() const { return cursor_; }
  /// Number of batches that were requested and have not come.
  int in_flight() const { return static_cast<int>(requested_ - cursor_) - num_here_; }

  /// Requests one sample of another kind, without any effect on the batches. Does nothing while an
  /// earlier request is unanswered. Requires: no batch has the same history.
  void AskWindows(const replay::SampleSpec& spec);
  /// Returns the sample that `AskWindows` requested if it has come since the last call, else null.
  /// Valid until the next `Next`.
  const replay::SampledRows* TakeWindows();

  /// Sends the server new priorities of rows that it sent, [C] each. If the message is lost, the
  /// rows only keep their old priorities.
  void SetPriorities(std::span<const std::int64_t> sequence, std::span<const float> priority);

  /// Requests the roles' reports. `status()` is the last answer.
  void AskStatus();
  const std::optional<proto::StatusReply>& status() const { return status_; }

  service::ReplayLink& link() { return link_; }

 private:
  void Request();
  /// Sends a request. Returns false if it cannot be sent now.
  [[nodiscard]] bool Ask(const replay::SampleSpec& spec);
  void Parse(const proto::SampleReply& reply, const replay::SampleSpec& spec,
             const transport::Frame& payload, replay::SampledRows* rows) const;
  bool Take(service::ReplayLink::Received received);

  service::ReplayLink link_;
  const env::StepShape shape_;
  const std::vector<replay::SampleSpec> specs_;  // [K]
  const int prefetch_;
  std::uint64_t cursor_;     // The next batch to be returned.
  std::uint64_t requested_;  // The next batch to be requested.
  int num_welcomes_ = 0;     // Welcomes of the link at the last request.
  RemoteBatches batches_;
  int num_here_ = 0;  // Number of batches from `cursor_` on that have come.
  std::optional<replay::SampleSpec> window_spec_;  // The spec of the last request.
  transport::Frame window_payload_;
  replay::SampledRows windows_;
  bool windows_came_ = false;
  int windows_asked_ = -1;  // num_welcomes() at the request; -1 if none is pending.
  std::optional<proto::StatusReply> status_;
};

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
