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
#include "learner/service/shard_turns.h"
#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/replay_link.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "replay/batch.h"
#include "replay/scan_mirror.h"

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
  /// batches are requested ahead. `mirror_places`: scans that are kept, so that the server sends
  /// each once; at most as many as its table has rows. 0: scans come with each batch.
  BatchStream(transport::Context& context, const transport::ClientOptions& replay,
              proto::Hello hello, const env::StepShape& shape,
              std::vector<replay::SampleSpec> specs, int prefetch, std::uint64_t cursor,
              std::int64_t mirror_places = 0);

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
  [[nodiscard]] bool Ask(const replay::SampleSpec& spec, bool is_mirrored);
  void Parse(const proto::SampleReply& reply, const replay::SampleSpec& spec,
             const transport::Frame& payload, replay::SampledRows* rows);
  bool Take(service::ReplayLink::Received received);

  service::ReplayLink link_;
  const env::StepShape shape_;
  const std::vector<replay::SampleSpec> specs_;  // [K]
  const int prefetch_;
  std::uint64_t cursor_;     // The next batch to be returned.
  std::uint64_t requested_;  // The next batch to be requested.
  int num_welcomes_ = 0;     // Welcomes of the link at the last request; the mirror's number.
  std::optional<replay::ScanMirror> mirror_;  // Of what came since then.
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

/// A source of batches from one replay server or several, the shards of a table, to which it also
/// sends the learner's reports.
///
/// The batches of an update come from one shard. Each shard grants as many as its own steps have
/// earned. Among the shards that have granted one, turns are in proportion to the steps that they
/// hold, or, if draws are prioritized, to the sums of their weights. So a row of any shard is as
/// likely to be drawn, while each is ahead. The others take the turns of a shard that is down.
class RemoteSource final : public BatchSource {
 public:
  /// Connects at `Start` to each of `replay`. Keeps references to `context`, `policies` and
  /// `registry`, which must outlive it. `prefetch`, `mirror_places`: as for each `BatchStream`.
  /// Requires: `replay` is not empty.
  RemoteSource(transport::Context& context, std::vector<transport::ClientOptions> replay,
               proto::Hello hello, const env::StepShape& shape,
               std::vector<replay::SampleSpec> specs, int prefetch, std::int64_t mirror_places,
               const PolicyServer& policies, metrics::Registry& registry);

  void Start() override;
  void Stop() override {}
  const std::vector<replay::SampledRows>* Next() override;
  bool IsWaiting() const override { return waiting_; }
  bool IsAtRest() const override { return true; }
  std::int64_t num_drawn() const override;
  std::int64_t steps() const override;
  EndedEpisodes TakeEndedEpisodes() override;
  void SetPriorities(std::span<const std::int64_t> sequence,
                     std::span<const float> priority) override;
  const replay::SampledRows* SampleForFigures(const replay::SampleSpec& spec) override;
  void Describe(run::MetricsRow& row) override;
  void Report(const run::MetricsRow& row, double seconds_left, bool finished) override;
  void Save(const std::filesystem::path& checkpoint, nlohmann::json& state) override;
  void Restore(const std::filesystem::path& checkpoint, const nlohmann::json& state) override;
  void KeepOnly(const std::vector<std::filesystem::path>&) override {}

  /// Keeps the connections alive when no more batches are wanted. Requires: `Start` was called.
  void Idle();

 private:
  struct Shard {
    transport::ClientOptions replay;
    std::uint64_t cursor = 0;               // Restored.
    std::unique_ptr<BatchStream> stream{};  // Made with the cursor of the checkpoint.
    std::int64_t steps = 0;                 // As the last batch said, like the two below.
    std::int64_t table_steps = 0;
    bool is_away = false;  // As was said last.
  };

  const RemoteBatches* TakeTurn();
  proto::StatusReply Status() const;
  std::vector<bool> AreWelcomed() const;
  void SayWhoIsAway();
  void Say(const std::string& what);

  transport::Context& context_;
  const proto::Hello hello_;
  const env::StepShape shape_;
  const std::vector<replay::SampleSpec> specs_;
  const int prefetch_;
  const std::int64_t mirror_places_;
  const PolicyServer& policies_;
  StreamMetrics metrics_;
  FinishedEpisodes finished_episodes_;
  std::vector<Shard> shards_;  // In the order of service.replay.
  ShardTurns turns_;
  std::vector<transport::Client*> clients_;  // Of the shards.
  Shard* last_ = nullptr;                    // That gave the last batch.

  bool waiting_ = true;
  double waited_s_ = 0.0;  // Since the last report.
  double acting_version_ = 0.0;
  EndedEpisodes ended_;
  std::string said_;
};

}  // namespace slalom::learner
