#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

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

}  // namespace slalom::learner
