#include "replay/table.h"

#include <algorithm>
#include <limits>

#include "base/check.h"

namespace slalom::replay {

Table::Table(const ReplayConfig& config, int num_beams)
    : config_(config),
      num_beams_(num_beams),
      slots_(static_cast<std::size_t>(config.capacity) * sizeof(Slot)),
      scans_(static_cast<std::size_t>(config.capacity) * num_beams * sizeof(std::uint16_t)) {
  SLALOM_CHECK_GE(config.capacity, 2);
  SLALOM_CHECK_LT(config.capacity, std::numeric_limits<std::uint32_t>::max());
  SLALOM_CHECK_GE(num_beams, 1);
}

void Table::Insert(const Chunk& chunk) {
  SLALOM_CHECK_EQ(chunk.num_beams, num_beams_);
  for (int r = 0; r < chunk.num_rows(); ++r) InsertRow(chunk.row(r));
}

void Table::InsertRow(const RowView& row) {
  const auto stream = static_cast<std::size_t>(row.stream);
  if (stream >= last_.size()) last_.resize(stream + 1, kClosed);
  const bool is_first = row.flags & kRowFirst;
  const bool is_final = row.flags & kRowFinal;
  // In a table being restored an episode may lack its beginning (overwritten) or its end (cut).
  if (!restoring_) SLALOM_CHECK_EQ(is_first, last_[stream] == kClosed);

  const std::int64_t sequence = total_;
  if (num_rows() == config_.capacity && !(slot(sequence).flags & kRowFinal)) --num_steps_;
  ++total_;
  if (!is_final) ++num_steps_;

  Slot& here = slot(sequence);
  std::copy(row.frame.state.begin(), row.frame.state.end(), here.state);
  here.action = row.action;
  here.reward = row.reward;
  here.cost = row.cost;
  here.to_previous = 0;
  here.to_next = 0;
  here.stream = row.stream;
  here.flags = row.flags;
  std::copy(row.frame.ranges_cm.begin(), row.frame.ranges_cm.end(),
            reinterpret_cast<std::uint16_t*>(scans_.data()) + SlotIndex(sequence) * num_beams_);

  if (priorities_ && is_final) priorities_->Clear(SlotIndex(sequence));
  if (priorities_ && !is_final) priorities_->SetNew(SlotIndex(sequence));

  const std::int64_t previous = last_[stream];
  if (!is_first && previous >= first_sequence()) {
    here.to_previous = static_cast<std::uint32_t>(sequence - previous);
    slot(previous).to_next = here.to_previous;
  }
  last_[stream] = is_final ? kClosed : sequence;
}

void Table::Cut(int stream) {
  SLALOM_CHECK_GE(stream, 0);
  if (stream < num_streams()) last_[static_cast<std::size_t>(stream)] = kClosed;
}

RowView Table::row(std::int64_t sequence) const {
  SLALOM_CHECK(sequence >= first_sequence() && sequence < total_);
  const Slot& here = slot(sequence);
  return {here.stream,
          here.flags,
          {{scan(sequence), static_cast<std::size_t>(num_beams_)},
           std::span<const float, env::kStateSize>(here.state)},
          here.action,
          here.reward,
          here.cost};
}

Table Table::BeginRestore(const ReplayConfig& config, int num_beams, std::int64_t start) {
  Table table(config, num_beams);
  SLALOM_CHECK_GE(start, 0);
  table.start_ = start;
  table.total_ = start;
  table.restoring_ = true;
  return table;
}

void Table::FinishRestore(std::span<const std::uint8_t> open) {
  SLALOM_CHECK(restoring_);
  restoring_ = false;
  last_.resize(std::max(open.size(), last_.size()), kClosed);
  for (std::size_t stream = 0; stream < last_.size(); ++stream) {
    const bool is_open = stream < open.size() && open[stream];
    if (!is_open) last_[stream] = kClosed;
    if (is_open && last_[stream] == kClosed) last_[stream] = kLost;
  }
}

}  // namespace slalom::replay
