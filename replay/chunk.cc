#include "replay/chunk.h"

#include "base/check.h"

namespace slalom::replay {

RowView Chunk::row(int r) const {
  const auto i = static_cast<std::size_t>(r);
  const auto n = static_cast<std::size_t>(num_beams);
  return {stream[i],
          flags[i],
          {std::span(ranges_cm).subspan(i * n, n),
           std::span(state).subspan(i * env::kStateSize).first<env::kStateSize>()},
          action[i],
          reward[i],
          cost[i]};
}

void Chunk::Clear() {
  stream.clear();
  flags.clear();
  ranges_cm.clear();
  state.clear();
  action.clear();
  reward.clear();
  cost.clear();
}

void Chunk::AddRow(const RowView& row) {
  SLALOM_CHECK_GE(row.stream, 0);
  SLALOM_CHECK_EQ(row.frame.ranges_cm.size(), static_cast<std::size_t>(num_beams));
  stream.push_back(row.stream);
  flags.push_back(row.flags);
  ranges_cm.insert(ranges_cm.end(), row.frame.ranges_cm.begin(), row.frame.ranges_cm.end());
  state.insert(state.end(), row.frame.state.begin(), row.frame.state.end());
  action.push_back(row.action);
  reward.push_back(row.reward);
  cost.push_back(row.cost);
}

int Chunk::BeginStep(int stream_index, bool first, const env::FrameView& frame, env::Action taken) {
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

void Chunk::AddStep(int stream_index, bool first, const env::FrameView& frame, env::Action taken,
                    const env::StepResult& result) {
  SetResult(BeginStep(stream_index, first, frame, taken), result);
}

void Chunk::AddFinal(int stream_index, const env::FrameView& frame) {
  AddRow({stream_index, kRowFinal, frame, {}, 0.0f, 0.0f});
}

}  // namespace slalom::replay
