#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "proto/messages.h"
#include "replay/batch.h"
#include "service/replay_link.h"
#include "transport/client.h"
#include "transport/context.h"
#include "transport/frame.h"

namespace slalom::learner {

/// What one update learns from, as it came from the replay server: a batch of each kind. Their
/// scans lie in the messages.
struct RemoteBatches {
  proto::SampleReply header;               ///< Of the last.
  std::vector<transport::Frame> payloads;  ///< [K]
  std::vector<replay::SampledRows> rows;   ///< [K], pointing into `payloads`.
};

/// Fetches the batches of a run in order, several ahead, over whatever happens to the connection:
/// batch k is asked for again until it came, and no other takes its place. Of K kinds, batch k is
/// of kind k mod K. Confined to one thread; ZeroMQ's thread receives meanwhile.
class BatchStream {
 public:
  /// Begins at batch `cursor`, a multiple of specs.size(). `prefetch`: updates ahead.
  BatchStream(transport::Context& context, const transport::ClientOptions& replay,
              proto::Hello hello, std::vector<replay::SampleSpec> specs, int prefetch,
              std::uint64_t cursor);

  /// The next batch of each kind, valid until the next call; null: they did not come within
  /// `timeout`. Throws `base::Error` where the server refuses this learner for good or sends what
  /// is no batch.
  const RemoteBatches* Next(std::chrono::milliseconds timeout);

  /// Number of the next batch: what a checkpoint keeps.
  std::uint64_t cursor() const { return cursor_; }
  /// Batches asked for that have not come.
  int in_flight() const { return static_cast<int>(requested_ - cursor_) - num_here_; }

  /// Asks for samples of another kind, once, beside the batches: those come as if this had not
  /// been. Nothing while an earlier request is unanswered. Requires: its history is no batch's.
  void AskWindows(const replay::SampleSpec& spec);
  /// What came of it since the last call, valid until the next `Next`; null: nothing.
  const replay::SampledRows* TakeWindows();

  /// Tells the server the new priorities of rows it sent, [C] each. One that is lost on the way
  /// only means an older priority.
  void SetPriorities(std::span<const std::int64_t> sequence, std::span<const float> priority);

  /// Asks for the roles' reports; what came last is `status()`.
  void AskStatus();
  const std::optional<proto::StatusReply>& status() const { return status_; }

  service::ReplayLink& link() { return link_; }

 private:
  void Request();
  /// False: not now.
  [[nodiscard]] bool Ask(const replay::SampleSpec& spec);
  void Parse(const proto::SampleReply& reply, const replay::SampleSpec& spec,
             const transport::Frame& payload, replay::SampledRows* rows) const;
  bool Take(service::ReplayLink::Received received);

  service::ReplayLink link_;
  const std::vector<replay::SampleSpec> specs_;  // [K]
  const int prefetch_;
  std::uint64_t cursor_;     // Next to be handed out.
  std::uint64_t requested_;  // Next to be asked for.
  int num_welcomes_ = 0;     // Of the link, when the last request was made.
  RemoteBatches batches_;
  int num_here_ = 0;                               // Of the batches from `cursor_` on.
  std::optional<replay::SampleSpec> window_spec_;  // As asked for last.
  transport::Frame window_payload_;
  replay::SampledRows windows_;
  bool windows_came_ = false;
  int windows_asked_ = -1;  // Welcomes when they were asked for; -1: none are on their way.
  std::optional<proto::StatusReply> status_;
};

}  // namespace slalom::learner
