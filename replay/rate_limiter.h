#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace slalom::replay {

/// Keeps samples and inserted steps at a fixed ratio by holding back the side that is ahead, with
/// one cursor per learner (as the rate limiter of Reverb). It only decides; its owner makes
/// requests wait: the desks of a replay server, or the source of a run in one process.
/// Thread-compatible.
///
/// Granted batches, summed over the learners' cursors, never exceed the number that the steps have
/// earned: updates_per_step * batches_per_update * (steps - learning_starts). Steps never run more
/// than `max_ahead_steps` ahead of the steps that earned the granted batches. This also holds while
/// no learner is connected: otherwise an ever older policy would make steps that push better ones
/// out of the table, and the learner would have to catch up.
class RateLimiter {
 public:
  struct Options {
    double updates_per_step = 0.25;
    int batches_per_update = 1;
    std::int64_t learning_starts = 0;  ///< Steps before these earn nothing.
    std::int64_t max_ahead_steps = 0;  ///< 0: inserts are never held back.
  };
  static constexpr int kMaxLearners = 64;

  /// Requires: updates_per_step > 0, batches_per_update >= 1, the others >= 0. `max_ahead_steps`
  /// counts as at least the steps that earn one batch: with fewer, both sides could wait for the
  /// other.
  RateLimiter(const Options& options, std::int64_t steps);

  void AddSteps(std::int64_t n) { steps_ += n; }

  /// Notes that a learner waits for the batch `cursor`. It asks for 0, 1, 2, ...; after a restart,
  /// it continues from its checkpoint, and batches granted beyond that no longer count.
  void Ask(const std::string& learner, std::uint64_t cursor);
  /// Whether the learner may have that batch now. Requires: `Ask` was called.
  bool MaySample(const std::string& learner) const;
  /// Notes that the learner got that batch.
  void Grant(const std::string& learner);
  /// Notes that a learner is gone. Its cursor stays, but is the first to be dropped for a new
  /// learner.
  void Leave(const std::string& learner);

  /// Whether the next chunk may be inserted. True if a learner waits for a batch that is not earned
  /// yet, so that both sides never wait at the same time.
  bool MayInsert() const;
  /// Sets whether a batch is due that cannot be drawn from the present rows. If so, inserts are let
  /// in regardless of the ratio.
  void SetStarved(bool starved) { starved_ = starved; }

  /// The learners and their cursors as a text with a checksum, for `RestoreCursors`.
  std::string PrintCursors() const;
  /// Takes the learners of before a restart, which count as gone until they ask. Returns the fault
  /// of a text that is damaged, and takes nothing then.
  std::optional<base::Failure> RestoreCursors(std::string_view text);

  std::int64_t steps() const { return steps_; }
  /// Number of granted batches: the sum of the learners' cursors.
  double granted() const;
  double batches_per_step() const { return batches_per_step_; }

 private:
  struct Learner {
    std::uint64_t next = 0;  ///< The next batch, which is also the number granted.
    bool present = false;
    std::uint64_t used = 0;  ///< Number of the call that used it last.
  };

  void MakeRoom();

  const Options options_;
  const double batches_per_step_;
  std::int64_t steps_;
  bool starved_ = false;
  std::uint64_t calls_ = 0;
  std::map<std::string, Learner> learners_;
};

}  // namespace slalom::replay
