#include <fmt/format.h>

#include <vector>

#include "base/check.h"
#include "replay/rows.h"
#include "replay/table.h"

namespace slalom::replay {

std::optional<base::Failure> Table::CheckEpisodes(const RowBytes& rows, int stream_base) const {
  SLALOM_CHECK_GE(stream_base, 0);
  if (rows.num_beams() != num_beams_) {
    return base::Failure{
        fmt::format("rows have scans of {} beams, expected {}", rows.num_beams(), num_beams_)};
  }
  enum class Episode : std::uint8_t { kNone, kRunning, kTerminated };
  std::vector<Episode> episodes(static_cast<std::size_t>(rows.num_streams()), Episode::kNone);
  for (int s = 0; s < rows.num_streams(); ++s) {
    if (!is_open(stream_base + s)) continue;
    const std::int64_t last =
        last_[static_cast<std::size_t>(stream_base) + static_cast<std::size_t>(s)];
    const bool terminated = last >= first_sequence() && (slot(last).flags & kRowTerminated);
    episodes[s] = terminated ? Episode::kTerminated : Episode::kRunning;
  }
  for (int r = 0; r < rows.num_rows(); ++r) {
    Episode& episode = episodes[rows.stream(r)];
    const std::uint8_t flags = rows.flags(r);
    const auto fail = [&](std::string_view found, std::string_view expected) {
      return base::Failure{fmt::format("row {}, stream {}: found {}, expected {}", r,
                                       rows.stream(r), found, expected)};
    };
    if (episode == Episode::kNone && !(flags & kRowFirst)) {
      return fail(flags & kRowFinal ? "the end of an episode" : "a step in mid-episode",
                  "the first step of an episode, as none is running");
    }
    if (episode != Episode::kNone && (flags & kRowFirst)) {
      return fail("the first step of an episode", "a row of the episode that is still running");
    }
    if (episode == Episode::kTerminated && !(flags & kRowFinal)) {
      return fail("a step", "the final row of the episode, which has terminated");
    }
    episode = flags & kRowFinal        ? Episode::kNone
              : flags & kRowTerminated ? Episode::kTerminated
                                       : Episode::kRunning;
  }
  return std::nullopt;
}

void Table::InsertRows(const RowBytes& rows, int stream_base) {
  SLALOM_CHECK_EQ(rows.num_beams(), num_beams_);
  SLALOM_CHECK_GE(stream_base, 0);
  for (int r = 0; r < rows.num_rows(); ++r) {
    RowView row = rows.row(r);
    row.stream += stream_base;
    InsertRow(row);
  }
}

}  // namespace slalom::replay
