#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "env/action.h"
#include "env/episode.h"
#include "env/observation.h"

/// Shapes: `R` rows, `N` beams, `S` = env::kStateSize.

namespace slalom::replay {

/// What a row is, as bits: the flags byte of part files and messages.
inline constexpr std::uint8_t kRowFinal = 1;       ///< Last frame of an episode, without an action.
inline constexpr std::uint8_t kRowTerminated = 2;  ///< The step ended in a terminal state.
inline constexpr std::uint8_t kRowFirst = 4;       ///< First step of an episode.

/// One frame and what was done in it. Views only.
struct RowView {
  std::int32_t stream = 0;
  std::uint8_t flags = 0;
  env::FrameView frame;
  env::Action action;  ///< Zero in a final row; so are reward and cost.
  float reward = 0.0f;
  float cost = 0.0f;
};

/// What some environments produced, row by row, on its way to a `Table`. Plain data;
/// thread-compatible.
///
/// A *stream* is one environment of one actor: its rows, in order, are episodes. An episode is one
/// or more steps (the frame that was seen, the action taken in it and what that gave), the first
/// marked so, then one final row with the frame in which it ended, whether terminated or truncated.
/// Streams interleave freely. Reused from step to step: `Clear` keeps the memory, so nothing is
/// allocated after the first few.
struct Chunk {
  Chunk() = default;
  explicit Chunk(int beams) : num_beams(beams) {}

  int num_beams = 0;
  std::vector<std::int32_t> stream;      ///< [R]
  std::vector<std::uint8_t> flags;       ///< [R], kRow... bits
  std::vector<std::uint16_t> ranges_cm;  ///< [R, N] [cm]
  std::vector<float> state;              ///< [R, S]
  std::vector<env::Action> action;       ///< [R]
  std::vector<float> reward;             ///< [R]
  std::vector<float> cost;               ///< [R]

  int num_rows() const { return static_cast<int>(stream.size()); }
  RowView row(int r) const;

  void Clear();

  /// Adds a step whose result is not known yet; returns its row for `SetResult`. The frame is
  /// copied, so the environment may be stepped next. Requires: stream >= 0, frame.ranges_cm.size()
  /// == num_beams.
  int BeginStep(int stream_index, bool first, const env::FrameView& frame, env::Action taken);
  void SetResult(int row, const env::StepResult& result);

  /// Both in one, for a frame that was kept.
  void AddStep(int stream_index, bool first, const env::FrameView& frame, env::Action taken,
               const env::StepResult& result);

  /// Adds the frame in which the episode of a stream ended.
  void AddFinal(int stream_index, const env::FrameView& frame);

  /// Adds a row as another chunk or a table gave it.
  void AddRow(const RowView& row);
};

}  // namespace slalom::replay
