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
    v("capacity", capacity, base::Range{16, 1e9}, "rows",
      "Rows that the buffer keeps, the oldest overwritten first. A step takes one row of about 1.5 "
      "kB, the end of an episode one more.");
  }
};

/// The replay buffer: a ring of rows, each with its frame stored once. Transitions with history and
/// n-step returns are assembled from them when they are sampled.
///
/// Rows are numbered by `sequence`, 0 being the first ever inserted; row s lies in slot s %
/// capacity. Each row links to the previous and next row of its stream, so streams may interleave.
///
/// A step may be drawn if the table holds its whole window and history. The window is `n_step`
/// steps and the frame after them. If the episode ended before, the window is shorter, and the
/// value is bootstrapped from the final frame with discount gamma^k (0 if it terminated); but in an
/// episode that is still open or was cut, only windows of `n_step` steps count. The history is
/// `history` frames; before the start of the episode, copies of its first frame stand in.
///
/// Thread-compatible: one owner. Movable. Memory: 24 + 4 (S + A) + 2 N bytes per row
/// (`env::StepShape`), taken as rows come.
/// Source: n-step TD3 of docs/original-system.md, section 3.1 without the faults F2 to F4 of
/// section 3.4.
class Table {
 public:
  /// Requires: config.capacity >= 2. Throws `base::Error` if there is not enough memory.
  Table(const ReplayConfig& config, const env::StepShape& shape);

  /// Appends the rows. Requires: chunk.shape == shape(); the rows of each stream form
  /// episodes as `Chunk` describes. Cost: a copy of the rows.
  void Insert(const Chunk& chunk);

  /// Appends rows straight from received bytes, as streams stream_base, stream_base + 1, ...
  /// Requires: `CheckEpisodes` returns nothing.
  void InsertRows(const RowBytes& rows, int stream_base);

  /// Checks rows from an untrusted peer. Returns the reason they cannot be inserted, or nothing if
  /// they can. Reasons: scans of another size, rows that do not continue the streams as they stand
  /// in the table (also after `FinishRestore`), and episodes that are not as `Chunk` describes.
  /// Cost: reads streams and flags.
  [[nodiscard]] std::optional<base::Failure> CheckEpisodes(const RowBytes& rows,
                                                           int stream_base) const;

  /// Ends the open episode of a stream without a final row, as after a resume. Its last steps,
  /// whose windows are incomplete, are never drawn. Does nothing if no episode is open.
  void Cut(int stream);

  /// Lets steps be drawn by priority, in proportion to p^alpha. The present steps and all new ones
  /// start with the largest priority ever set, or 1 if none was. Later calls do nothing. `Storage`
  /// does not save priorities. Requires: 0 <= alpha <= 1. Cost: 9 bytes per slot of the ring, and
  /// one path of the sum tree for each row held or inserted.
  void UsePriorities(double alpha);
  /// Returns the weights of all rows as the bytes of a file (docs/replay.md). Requires:
  /// has_priorities(). Cost: 8 bytes per row.
  std::string PrintPriorities() const;
  /// As `UsePriorities`, but restores the weight of each step from `bytes`. Steps that are not in
  /// the bytes start with the largest. Fails, and changes nothing, if the bytes are damaged or of
  /// another alpha. Requires: !has_priorities().
  [[nodiscard]] std::optional<base::Failure> RestorePriorities(std::string_view bytes,
                                                               double alpha);
  bool has_priorities() const { return priorities_.has_value(); }
  /// The sum of the weights of all steps. Requires: has_priorities().
  double total_weight() const { return priorities_->total(); }
  /// Sets the priorities of steps by row number. Skips rows that are no longer held, and final
  /// rows. Returns how many were set. Requires: has_priorities(); both spans have the same size.
  std::int64_t SetPriorities(std::span<const std::int64_t> sequences,
                             std::span<const float> priorities);

  /// Draws `spec.batch` steps independently from those that may be drawn: uniformly or, if
  /// `spec.prioritized`, in proportion to their weights. In that case `rows->weight` is
  /// (smallest weight in the batch / weight)^beta. The same rows, weights, spec and state of
  /// `random` give the same result, however the rows were inserted or restored. Returns false,
  /// leaving `rows` unspecified, if no step may be drawn (yet). Requires: batch, history, n_step >=
  /// 1; prioritized only if has_priorities().
  [[nodiscard]] bool SampleRows(const SampleSpec& spec, base::Random& random,
                                SampledRows* rows) const;

  /// As `SampleRows`, and copies the scans.
  [[nodiscard]] bool Sample(const SampleSpec& spec, base::Random& random, Batch* batch) const;

  /// Number of steps that may be drawn. Cost: a walk over the table.
  std::int64_t CountEligible(int history, int n_step) const;

  /// Returns the number of the row whose scan this is. Requires: a row that is held has it.
  std::int64_t SequenceOf(const std::uint16_t* scan) const;

  /// Returns a row, valid until the next `Insert`. Requires: first_sequence() <= sequence <
  /// total_inserted().
  RowView row(std::int64_t sequence) const;

  const env::StepShape& shape() const { return shape_; }
  const ReplayConfig& config() const { return config_; }
  /// Number of steps held: rows that are not final.
  std::int64_t num_steps() const { return num_steps_; }
  /// Number of rows held, final ones included.
  std::int64_t num_rows() const { return total_ - first_sequence(); }
  std::int64_t total_inserted() const { return total_; }
  /// Number of the oldest row held.
  std::int64_t first_sequence() const {
    return total_ - config_.capacity > start_ ? total_ - config_.capacity : start_;
  }
  /// Memory of the rows held, in bytes.
  std::int64_t bytes() const {
    return num_rows() *
           static_cast<std::int64_t>(slot_bytes_ + sizeof(std::uint16_t) * shape_.num_beams);
  }

  int num_streams() const { return static_cast<int>(last_.size()); }
  bool is_open(int stream) const {
    return stream < num_streams() && last_[static_cast<std::size_t>(stream)] != kClosed;
  }

  /// Returns an empty table whose next row gets the number `start`, for `Storage` and the journal.
  /// `Insert` the rows of the saved table in their order, then call `FinishRestore`. Streams may
  /// start in the middle of an episode.
  static Table BeginRestore(const ReplayConfig& config, const env::StepShape& shape,
                            std::int64_t start);
  /// Restores the state of each stream: open[i] says whether an episode of stream i is running.
  void FinishRestore(std::span<const std::uint8_t> open);

 private:
  /// A row without its scan. Its state [S] and action [A] follow it in memory.
  struct Slot {
    float reward;
    float cost;
    std::uint32_t to_previous;  ///< Distance to the episode's previous row; 0 if none or lost.
    std::uint32_t to_next;      ///< Distance to the episode's next row; 0 if not there.
    std::int32_t stream;
    std::uint8_t flags;
  };
  static_assert(sizeof(Slot) == 24);

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
    return *reinterpret_cast<Slot*>(slots_.data() + SlotIndex(sequence) * slot_bytes_);
  }
  const Slot& slot(std::int64_t sequence) const {
    return *reinterpret_cast<const Slot*>(slots_.data() + SlotIndex(sequence) * slot_bytes_);
  }
  std::span<const float> state(const Slot& slot) const {
    return {reinterpret_cast<const float*>(&slot + 1), static_cast<std::size_t>(shape_.state_size)};
  }
  std::span<const float> action(const Slot& slot) const {
    return {reinterpret_cast<const float*>(&slot + 1) + shape_.state_size,
            static_cast<std::size_t>(shape_.action_size)};
  }
  const std::uint16_t* scan(std::int64_t sequence) const {
    return reinterpret_cast<const std::uint16_t*>(scans_.data()) +
           SlotIndex(sequence) * shape_.num_beams;
  }

  ReplayConfig config_;
  env::StepShape shape_;
  std::int64_t slot_bytes_;  ///< Of a slot with its state and action.
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
