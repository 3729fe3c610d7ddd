#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "env/episode.h"
#include "env/observation.h"
#include "env/step_shape.h"

/// Shapes: `R` rows; `N`, `S` and `A` of `env::StepShape`.

namespace slalom::replay {

/// The bits of a row's flags, as they are in memory, in messages and on disk.
inline constexpr std::uint8_t kRowFinal = 1;       ///< Last frame of an episode, without an action.
inline constexpr std::uint8_t kRowTerminated = 2;  ///< The step led to a terminal state.
inline constexpr std::uint8_t kRowFirst = 4;       ///< First step of an episode.

/// One row: a frame, the action taken in it and the result. Views only.
struct RowView {
  std::int32_t stream = 0;
  std::uint8_t flags = 0;
  env::FrameView frame;
  std::span<const float> action;  ///< [A]; zeros in a final row, as are reward and cost.
  float reward = 0.0f;
  float cost = 0.0f;
};

/// Rows of some environments, on their way to a `Table`. Plain data; thread-compatible.
///
/// A *stream* is the sequence of rows of one environment of one actor: episode after episode. An
/// episode is one or more step rows (the frame seen, the action taken, reward and cost), the first
/// of them flagged `kRowFirst`, then one final row with the frame in which the episode ended,
/// whether terminated or truncated. Streams interleave freely. Reuse one object from step to step:
/// `Clear` keeps the memory, so that only the first few calls allocate.
struct Chunk {
  Chunk() = default;
  explicit Chunk(const env::StepShape& step) : shape(step) {}

  env::StepShape shape;
  std::vector<std::int32_t> stream;      ///< [R]
  std::vector<std::uint8_t> flags;       ///< [R], kRow... bits
  std::vector<std::uint16_t> ranges_cm;  ///< [R, N] [cm]
  std::vector<float> state;              ///< [R, S]
  std::vector<float> action;             ///< [R, A]
  std::vector<float> reward;             ///< [R]
  std::vector<float> cost;               ///< [R]

  int num_rows() const { return static_cast<int>(stream.size()); }
  int num_steps() const;  ///< Rows that are not final.
  RowView row(int r) const;

  void Clear() { Truncate(0); }
  /// Keeps the first rows. Requires: 0 <= num_rows <= this->num_rows().
  void Truncate(int num_rows);

  /// Adds a step whose result is not known yet, and returns its row for `SetResult`. Copies the
  /// frame, so that the environment may be stepped next. Requires: stream_index >= 0,
  /// frame and `taken` have the chunk's shape; an empty `taken` stands for zeros.
  int BeginStep(int stream_index, bool first, const env::FrameView& frame,
                std::span<const float> taken);
  void SetResult(int row, const env::StepResult& result);

  /// Adds a step with its result.
  void AddStep(int stream_index, bool first, const env::FrameView& frame,
               std::span<const float> taken, const env::StepResult& result);

  /// Adds the final row of an episode: the frame in which it ended.
  void AddFinal(int stream_index, const env::FrameView& frame);

  /// Adds a copy of a row of another chunk or a table.
  void AddRow(const RowView& row);
};

}  // namespace slalom::replay
