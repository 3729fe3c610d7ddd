#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages.h"
#include "replay/batch.h"
#include "replay/rate_limiter.h"
#include "replay/sample_bytes.h"
#include "replay/scan_mirror.h"
#include "replay/service/reply_sender.h"
#include "replay/table.h"

namespace slalom::replay {

/// Serves the learners: sends samples, held until the rate limiter grants them, and takes
/// priorities.
///
/// The batch of cursor k is drawn with `Random(DeriveSeed(seed, "sample", {k}))`. A peer's requests
/// are answered in their order. Confined to the server's thread. Memory per peer: `kMaxRequests`
/// requests and one sample, in addition to its connection's queue, and 4 bytes for each row of the
/// table for each of the `kMaxMirrors` learners that have a mirror.
class SampleDesk {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// The most unanswered requests of a peer: the largest `learner_service.prefetch`, 256 updates,
  /// with up to four batches each, and one sample to measure a transition model.
  static constexpr std::size_t kMaxRequests = 1025;

  static constexpr int kMaxMirrors = 8;

  struct Options {
    std::uint64_t seed = 1;
    std::int64_t max_sample_bytes = 64 << 20;
    double priority_exponent = 0.6;  ///< alpha
  };

  /// Counts since the start. Plain data.
  struct Counts {
    std::int64_t batches = 0;
    std::int64_t samples = 0;
    std::int64_t priorities_set = 0;
    std::int64_t priorities_stale = 0;
  };

  /// The pointers must outlive the desk.
  SampleDesk(const Options& options, Table* table, RateLimiter* limiter, ReplySender* replies);

  /// Takes a request. `learner`: the name in the peer's hello. Requires: the request is within the
  /// bounds of `proto::Decode`.
  void Ask(const transport::PeerId& peer, const std::string& learner,
           const proto::SampleRequest& request);
  void SetPriorities(const transport::PeerId& peer, const proto::PriorityUpdate& update,
                     std::span<const std::byte> payload);
  /// Notes that the peer's connection is gone, and drops its requests.
  void Gone(const transport::PeerId& peer);
  /// Notes that the peer has been silent for long. Until its next request, its cursor is the first
  /// to be dropped for another learner (`RateLimiter::Leave`). Inserts are still held back for it.
  void Silent(const transport::PeerId& peer);

  /// Answers at most `max_replies` due requests, taking peers in turn. `acting_version`: the policy
  /// version of the newest chunks, which replies report. Returns true if there is more to do at
  /// once.
  bool Advance(int max_replies, double acting_version);

  /// Number of unanswered requests, and of those among them that the rate limiter holds.
  std::int64_t num_waiting() const;
  std::int64_t num_held() const { return num_held_; }
  /// Whether a learner waits for a batch that cannot be drawn from the present rows.
  bool starved() const { return starved_; }
  const Counts& counts() const { return counts_; }
  /// Returns the times that batches took to draw and gather since the last call, [s].
  std::vector<double> TakeSampleSeconds();

 private:
  /// A peer's requests, and its next reply if that is ready but the peer does not read.
  struct Line {
    std::string learner;
    std::deque<proto::SampleRequest> requests;
    std::optional<transport::Message> ready;
    bool silent = false;
    std::uint64_t mirror = 0;  ///< Number of the learner's mirror; 0: it has none.
    int mirror_places = 0;
    std::optional<MirroredRows> mirrored{};
  };
  enum class Step {
    kSent,
    kHeld,     ///< The batch is not earned yet, or cannot be drawn.
    kBlocked,  ///< The peer does not read.
    kGone,
  };

  Step Answer(const transport::PeerId& peer, Line* line, double acting_version);
  [[nodiscard]] bool Draw(const proto::SampleRequest& request);
  /// The mirror that a reply counts on; null if it has all scans.
  MirroredRows* MirrorOf(const proto::SampleRequest& request, Line* line);
  /// Makes the reply with the sample that was drawn.
  transport::Message Reply(const proto::SampleRequest& request, Line* line, double acting_version);
  void Refuse(const transport::PeerId& peer, proto::RefusalCode code, std::string_view text,
              std::uint64_t about);

  const Options options_;
  Table* const table_;
  RateLimiter* const limiter_;
  ReplySender* const replies_;
  std::map<transport::PeerId, Line> lines_;
  transport::PeerId last_;  ///< The peer that was answered last.
  SampledRows rows_;
  MirroredScans scans_;
  bool starved_ = false;
  std::int64_t retry_at_ = 0;  ///< Rows inserted at which a starved draw is tried again.
  std::int64_t num_held_ = 0;
  Counts counts_;
  std::vector<double> sample_seconds_;
};

}  // namespace slalom::replay
