#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_field.h"
#include "base/random.h"
#include "base/result.h"
#include "replay/batch.h"
#include "replay/chunk.h"
#include "replay/lazy_memory.h"
#include "replay/priorities.h"

namespace slalom::replay {

class RowBytes;

/// The size of a replay buffer.
struct ReplayConfig {
  std::int64_t capacity = 200000;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("capacity", capacity, base::Range{16, 1e9}, "frames",
      "Frames kept, oldest overwritten first; a step is one, the end of an episode one more (1.5 "
      "kB each).");
  }
};

/// The replay buffer: a ring of frames, each stored once, from which transitions with history and
/// n-step returns are put together when they are sampled.
///
/// Rows are numbered by `sequence`, 0 for the first ever inserted; row s lies in slot s % capacity.
/// Each row links to the one before and after it in its stream, so streams may interleave. A step
/// may be drawn when its window is whole: `n_step` steps and the frame after them, or fewer where
/// the episode ended (then bootstrapping from the final frame with discount gamma^k, or 0 where it
/// terminated); in an episode still open or cut only whole windows count. And its history must be
/// there: `history` frames, or back to the first of the episode, whose frame stands in for those
/// before it.
///
/// Thread-compatible: one owner. Movable. Memory: 48 + 2 N bytes a row, taken as rows come.
/// Source: n-step TD3 (docs/original-system.md, section 3.1), without the faults F2 to F4 of
/// section 3.4.
class Table {
 public:
  /// Requires: config.capacity >= 2, num_beams >= 1. Throws `base::Error` where there is no memory.
  Table(const ReplayConfig& config, int num_beams);

  /// Appends the rows. Requires: chunk.num_beams == num_beams(); in each stream, episodes as
  /// `Chunk` says. Cost: a copy of the rows.
  void Insert(const Chunk& chunk);

  /// Appends the rows, straight from the bytes in which they came, as streams stream_base,
  /// stream_base + 1, ... Requires: `CheckEpisodes` finds nothing.
  void InsertRows(const RowBytes& rows, int stream_base);

  /// Why rows that anybody may have sent cannot be inserted: scans of another size, or episodes
  /// that do not go on as these streams stand in the table or are not as `Chunk` says (in a table
  /// after `FinishRestore`, too). Nothing: they can. Cost: looks at streams and flags.
  [[nodiscard]] std::optional<base::Failure> CheckEpisodes(const RowBytes& rows,
                                                           int stream_base) const;

  /// Ends the open episode of a stream without a final frame, as after a resume: its last steps,
  /// whose windows would need what never came, are not drawn. Nothing where no episode is open.
  void Cut(int stream);

  /// Lets steps be drawn by priority, in proportion to p^alpha; those held now, and all new ones,
  /// begin with the largest priority ever set, at first 1. Nothing where it was called before.
  /// Priorities are no part of what `Storage` keeps. Requires: 0 <= alpha <= 1. Cost: 9 bytes a
  /// slot of the ring, and a path of the sum tree for each row held or inserted.
  void UsePriorities(double alpha);
  /// The weights of the rows held as the bytes of a file (docs/replay.md). Requires:
  /// has_priorities(). Cost: 8 bytes a row.
  std::string PrintPriorities() const;
  /// As `UsePriorities`, but gives each step held the weight that it had; those the bytes know
  /// nothing of begin with the largest. Fails, and changes nothing, where the bytes are damaged or
  /// of another alpha. Requires: !has_priorities().
  [[nodiscard]] std::optional<base::Failure> RestorePriorities(std::string_view bytes,
                                                               double alpha);
  bool has_priorities() const { return priorities_.has_value(); }
  /// Sets the priorities of steps, rows by number; those no longer held, and final ones, are passed
  /// over. Returns how many were set. Requires: has_priorities(), one priority for each number.
  std::int64_t SetPriorities(std::span<const std::int64_t> sequences,
                             std::span<const float> priorities);

  /// Draws `spec.batch` steps independently from those that may be drawn, each uniformly, or in
  /// proportion to its weight where `spec.prioritized`: then `rows->weight` is
  /// (smallest weight of the batch / weight)^beta. The same rows, weights, spec and state of
  /// `random` give the same result, however rows were inserted or restored. False: there is no such
  /// step (yet); `rows` is then unspecified. Requires: batch, history, n_step >= 1; prioritized
  /// only where has_priorities().
  [[nodiscard]] bool SampleRows(const SampleSpec& spec, base::Random& random,
                                SampledRows* rows) const;

  /// As above, and copies the scans.
  [[nodiscard]] bool Sample(const SampleSpec& spec, base::Random& random, Batch* batch) const;

  /// Number of steps that may be drawn. Cost: a walk over the table.
  std::int64_t CountEligible(int history, int n_step) const;

  /// The row of a number in [first_sequence(), total_inserted()); valid until the next `Insert`.
  RowView row(std::int64_t sequence) const;

  int num_beams() const { return num_beams_; }
  const ReplayConfig& config() const { return config_; }
  /// Steps held, without final frames.
  std::int64_t num_steps() const { return num_steps_; }
  /// Frames held, with final frames.
  std::int64_t num_rows() const { return total_ - first_sequence(); }
  std::int64_t total_inserted() const { return total_; }
  /// The oldest row held.
  std::int64_t first_sequence() const {
    return total_ - config_.capacity > start_ ? total_ - config_.capacity : start_;
  }
  /// Memory that the rows held take.
  std::int64_t bytes() const {
    return num_rows() *
           static_cast<std::int64_t>(sizeof(Slot) + sizeof(std::uint16_t) * num_beams_);
  }

  int num_streams() const { return static_cast<int>(last_.size()); }
  bool is_open(int stream) const {
    return stream < num_streams() && last_[static_cast<std::size_t>(stream)] != kClosed;
  }

  /// An empty table whose next row has the number `start`, to which the rows of an earlier one are
  /// then `Insert`ed in order, streams beginning in the middle of an episode where it began before;
  /// then `FinishRestore`. Used by `Storage`.
  static Table BeginRestore(const ReplayConfig& config, int num_beams, std::int64_t start);
  /// Gives each stream the state that it had: open[i] says whether an episode of stream i is
  /// running.
  void FinishRestore(std::span<const std::uint8_t> open);

 private:
  /// All of a row but its scan.
  struct Slot {
    float state[env::kStateSize];
    env::Action action;
    float reward;
    float cost;
    std::uint32_t to_previous;  ///< Rows back to the one before in the episode; 0: none or lost.
    std::uint32_t to_next;      ///< Rows on to the one after; 0: not there.
    std::int32_t stream;
    std::uint8_t flags;
  };
  static_assert(sizeof(Slot) == 48);

  struct Window;

  static constexpr std::int64_t kClosed = -1;  ///< In `last_`: no episode is open.
  static constexpr std::int64_t kLost = -2;    ///< Open, but its last row is no longer held.

  void InsertRow(const RowView& row);
  void DrawBlock(const SampleSpec& spec, base::Random& random, std::span<Window> windows,
                 int* num_drawn) const;
  void FollowWindows(const SampleSpec& spec, std::span<Window> windows) const;
  bool HasHistory(std::int64_t sequence, int history) const;
  bool IsEligible(std::int64_t sequence, const SampleSpec& spec) const;
  std::vector<std::int64_t> ListEligible(const SampleSpec& spec) const;
  void DrawSequences(bool prioritized, base::Random& random,
                     std::span<std::int64_t> sequences) const;
  void DrawFrom(std::span<const std::int64_t> eligible, bool prioritized, base::Random& random,
                std::span<std::int64_t> sequences) const;
  void WriteWeights(double importance_exponent, SampledRows* rows) const;
  void WriteHistory(std::int64_t sequence, int history, const std::uint16_t** ranges_cm,
                    float* state) const;

  std::int64_t SlotIndex(std::int64_t sequence) const { return sequence % config_.capacity; }
  Slot& slot(std::int64_t sequence) {
    return reinterpret_cast<Slot*>(slots_.data())[SlotIndex(sequence)];
  }
  const Slot& slot(std::int64_t sequence) const {
    return reinterpret_cast<const Slot*>(slots_.data())[SlotIndex(sequence)];
  }
  const std::uint16_t* scan(std::int64_t sequence) const {
    return reinterpret_cast<const std::uint16_t*>(scans_.data()) + SlotIndex(sequence) * num_beams_;
  }

  ReplayConfig config_;
  int num_beams_;
  LazyMemory slots_;
  LazyMemory scans_;
  std::int64_t start_ = 0;  ///< Number of the first row ever inserted here.
  std::int64_t total_ = 0;  ///< Number of the next row.
  std::int64_t num_steps_ = 0;
  std::vector<std::int64_t> last_;  ///< [streams], last row of the open episode, kClosed or kLost.
  bool restoring_ = false;
  std::optional<Priorities> priorities_;
};

}  // namespace slalom::replay
