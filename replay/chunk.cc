#include "replay/chunk.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::replay {

RowView Chunk::row(int r) const {
  const auto i = static_cast<std::size_t>(r);
  const auto row_of = [i](const auto& column, int width) {
    return std::span(column).subspan(i * width, width);
  };
  return {stream[i],
          flags[i],
          {row_of(ranges_cm, shape.num_beams), row_of(state, shape.state_size)},
          row_of(action, shape.action_size),
          reward[i],
          cost[i]};
}

int Chunk::num_steps() const {
  return static_cast<int>(std::ranges::count_if(
      flags, [](std::uint8_t row_flags) { return (row_flags & kRowFinal) == 0; }));
}

void Chunk::Truncate(int num_rows) {
  const auto rows = static_cast<std::size_t>(num_rows);
  SLALOM_CHECK_LE(rows, stream.size());
  stream.resize(rows);
  flags.resize(rows);
  ranges_cm.resize(rows * static_cast<std::size_t>(shape.num_beams));
  state.resize(rows * static_cast<std::size_t>(shape.state_size));
  action.resize(rows * static_cast<std::size_t>(shape.action_size));
  reward.resize(rows);
  cost.resize(rows);
}

void Chunk::AddRow(const RowView& row) {
  SLALOM_CHECK_GE(row.stream, 0);
  SLALOM_CHECK_EQ(row.frame.ranges_cm.size(), static_cast<std::size_t>(shape.num_beams));
  SLALOM_CHECK_EQ(row.frame.state.size(), static_cast<std::size_t>(shape.state_size));
  const auto action_size = static_cast<std::size_t>(shape.action_size);
  SLALOM_CHECK(row.action.empty() || row.action.size() == action_size);
  stream.push_back(row.stream);
  flags.push_back(row.flags);
  ranges_cm.insert(ranges_cm.end(), row.frame.ranges_cm.begin(), row.frame.ranges_cm.end());
  state.insert(state.end(), row.frame.state.begin(), row.frame.state.end());
  action.insert(action.end(), row.action.begin(), row.action.end());
  action.resize(stream.size() * action_size);
  reward.push_back(row.reward);
  cost.push_back(row.cost);
}

int Chunk::BeginStep(int stream_index, bool first, const env::FrameView& frame,
                     std::span<const float> taken) {
  AddRow({stream_index, first ? kRowFirst : std::uint8_t{0}, frame, taken, 0.0f, 0.0f});
  return num_rows() - 1;
}

void Chunk::SetResult(int row, const env::StepResult& result) {
  const auto i = static_cast<std::size_t>(row);
  SLALOM_CHECK_LT(i, stream.size());
  reward[i] = result.reward;
  cost[i] = result.cost;
  if (result.terminated()) flags[i] |= kRowTerminated;
}

void Chunk::AddStep(int stream_index, bool first, const env::FrameView& frame,
                    std::span<const float> taken, const env::StepResult& result) {
  SetResult(BeginStep(stream_index, first, frame, taken), result);
}

void Chunk::AddFinal(int stream_index, const env::FrameView& frame) {
  AddRow({stream_index, kRowFinal, frame, {}, 0.0f, 0.0f});
}

}  // namespace slalom::replay
