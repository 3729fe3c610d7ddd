#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace slalom::replay {

/// Holds samples to a fixed ratio of inserted steps from both sides, with one cursor for each
/// learner. Decides only; who waits is kept elsewhere. Thread-compatible.
///
/// Batches granted, summed over the learners' cursors, stay at or below what the steps have earned,
/// updates_per_step * (steps - learning_starts); and steps stay within `max_ahead_steps` of what
/// the granted batches were earned by, also while no learner is there: steps that nobody learns
/// from would be made by an ever older policy, push better ones out of the table, and have to be
/// caught up with.
class RateLimiter {
 public:
  struct Options {
    double updates_per_step = 0.25;
    std::int64_t learning_starts = 0;
    std::int64_t max_ahead_steps = 0;  ///< 0: inserts are never held.
  };
  static constexpr int kMaxLearners = 64;

  /// Requires: updates_per_step > 0, the others >= 0. `max_ahead_steps` counts as at least the
  /// steps that earn one batch: with fewer, both sides could wait for the other.
  RateLimiter(const Options& options, std::int64_t steps);

  void AddSteps(std::int64_t n) { steps_ += n; }

  /// A learner is there and waits for the batch of this number. It asks for 0, 1, 2, ...; after a
  /// restart for what its checkpoint says, and what it had beyond that no longer counts.
  void Ask(const std::string& learner, std::uint64_t cursor);
  /// Whether it may have it now. Requires: it asked.
  bool MaySample(const std::string& learner) const;
  /// It got it.
  void Grant(const std::string& learner);
  /// A learner is no longer there: its cursor stays, but it gives way to others first.
  void Leave(const std::string& learner);

  /// Whether the next chunk may be inserted. Where a learner
  /// waits for what the steps have not earned this is true, so both sides never wait at once.
  bool MayInsert() const;
  /// A batch is due and cannot be drawn from what is there: more rows must come in any case.
  void SetStarved(bool starved) { starved_ = starved; }

  std::int64_t steps() const { return steps_; }
  /// Batches that the learners' cursors stand for.
  double granted() const;

 private:
  struct Learner {
    std::uint64_t next = 0;  ///< Batches granted, by its cursor.
    bool present = false;
    std::uint64_t used = 0;  ///< When, in calls.
  };

  void MakeRoom();

  const Options options_;
  std::int64_t steps_;
  bool starved_ = false;
  std::uint64_t calls_ = 0;
  std::map<std::string, Learner> learners_;
};

}  // namespace slalom::replay
