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
#include "replay/service/rate_limiter.h"
#include "replay/service/reply_sender.h"
#include "replay/table.h"

namespace slalom::replay {

/// Serves the learners: samples, held until the rate limiter lets them go, and priorities.
///
/// The batch of cursor k is drawn with `Random(DeriveSeed(seed, "sample", {k}))`. A peer's requests
/// are answered in their order. Confined to the server's thread. Memory: `kMaxRequests` requests
/// and one sample a peer, beside what its connection's queue holds.
class SampleDesk {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Of a peer, unanswered: the largest `learner_service.prefetch`, 256 updates, of up to four
  /// batches each, and one to measure a model by.
  static constexpr std::size_t kMaxRequests = 1025;

  struct Options {
    std::uint64_t seed = 1;
    std::int64_t max_sample_bytes = 64 << 20;
    double priority_exponent = 0.6;  ///< alpha
  };

  /// What was counted since the start. Plain data.
  struct Counts {
    std::int64_t batches = 0;
    std::int64_t samples = 0;
    std::int64_t priorities_set = 0;
    std::int64_t priorities_stale = 0;
  };

  /// The pointers must outlive the desk.
  SampleDesk(const Options& options, Table* table, RateLimiter* limiter, ReplySender* replies);

  /// `learner`: the name that the peer said in its hello. Requires: the request is within the
  /// bounds of `proto::Decode`.
  void Ask(const transport::PeerId& peer, const std::string& learner,
           const proto::SampleRequest& request);
  void SetPriorities(const transport::PeerId& peer, const proto::PriorityUpdate& update,
                     std::span<const std::byte> payload);
  /// Its connection is no more: what it asked for is no longer wanted.
  void Gone(const transport::PeerId& peer);
  /// It has sent nothing for long: until it asks for the next sample, its place gives way to other
  /// learners' first (`RateLimiter::Leave`). Inserts stay held for it.
  void Silent(const transport::PeerId& peer);

  /// Answers at most `max_replies` of the requests that are due, peers in turn. `acting_version`:
  /// what replies say of the newest chunks. True: there is more that could be done at once.
  bool Advance(int max_replies, double acting_version);

  /// Requests unanswered, and those held by the rate limiter among them.
  std::int64_t num_waiting() const;
  std::int64_t num_held() const { return num_held_; }
  /// A learner waits for a batch that cannot be drawn from the rows that are there.
  bool starved() const { return starved_; }
  const Counts& counts() const { return counts_; }
  /// Times that batches took to draw and gather since the last call, [s].
  std::vector<double> TakeSampleSeconds();

 private:
  /// A peer's requests, and its next reply where that is made but the peer does not read.
  struct Line {
    std::string learner;
    std::deque<proto::SampleRequest> requests;
    std::optional<transport::Message> ready;
    bool silent = false;
  };
  enum class Step {
    kSent,
    kHeld,     ///< Not earned yet, or not to be drawn.
    kBlocked,  ///< The peer does not read.
    kGone,
  };

  Step Answer(const transport::PeerId& peer, Line* line, double acting_version);
  [[nodiscard]] bool Draw(const proto::SampleRequest& request);
  void Refuse(const transport::PeerId& peer, proto::RefusalCode code, std::string_view text,
              std::uint64_t about);

  const Options options_;
  Table* const table_;
  RateLimiter* const limiter_;
  ReplySender* const replies_;
  std::map<transport::PeerId, Line> lines_;
  transport::PeerId last_;  ///< The peer that was answered last.
  SampledRows rows_;
  bool starved_ = false;
  std::int64_t retry_at_ = 0;  ///< Rows inserted at which a starved draw is tried again.
  std::int64_t num_held_ = 0;
  Counts counts_;
  std::vector<double> sample_seconds_;
};

}  // namespace slalom::replay
