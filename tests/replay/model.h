#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "base/random.h"
#include "replay/chunk.h"
#include "replay/table.h"

namespace slalom::replay {

/// Streams of random episodes and, beside the table they are inserted into, everything that was
/// ever inserted, as plain lists: what a transition ought to be is read off those by brute force.
class ReplayModel {
 public:
  struct Row {
    std::int64_t sequence = 0;
    std::uint8_t flags = 0;
    std::vector<std::uint16_t> ranges_cm;
    std::vector<float> state;
    std::vector<float> action;
    float reward = 0.0f;
    float cost = 0.0f;
  };
  struct Episode {
    std::vector<Row> steps;
    std::optional<Row> final_row;
  };
  struct Transition {
    std::vector<const Row*> history;
    std::vector<const Row*> next_history;
    double n_step_return = 0.0;
    double cost_return = 0.0;
    double discount = 0.0;
  };

  ReplayModel(std::int64_t capacity, const env::StepShape& shape, int num_streams,
              std::uint64_t seed);

  /// Steps every stream that feels like it once, into one chunk, and inserts it into `table`.
  void Advance(Table* table);

  /// The transition that starts with row `sequence`; none: it may not be drawn.
  std::optional<Transition> Expect(std::int64_t sequence, const SampleSpec& spec) const;

  /// Numbers of all rows that may be drawn.
  std::vector<std::int64_t> Eligible(const SampleSpec& spec) const;

  std::int64_t total() const { return total_; }
  std::int64_t oldest() const { return total_ > capacity_ ? total_ - capacity_ : 0; }
  std::int64_t num_steps() const;

 private:
  Row MakeRow(std::uint8_t flags);

  const std::int64_t capacity_;
  const env::StepShape shape_;
  base::Random random_;
  Chunk chunk_;
  std::int64_t total_ = 0;
  std::vector<std::vector<Episode>> streams_;
  std::map<std::int64_t, std::pair<int, int>> episode_of_;  ///< sequence -> (stream, episode)
};

}  // namespace slalom::replay
