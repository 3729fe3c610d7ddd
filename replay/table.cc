#include "replay/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/check.h"
#include "base/file.h"
#include "replay/batch.h"
#include "replay/rows.h"

namespace slalom::replay {

Table::Table(const ReplayConfig& config, const env::StepShape& shape)
    : config_(config),
      shape_(shape),
      slot_bytes_(static_cast<std::int64_t>(
          sizeof(Slot) + sizeof(float) * (shape.state_size + shape.action_size))),
      slots_(static_cast<std::size_t>(config.capacity * slot_bytes_)),
      scans_(static_cast<std::size_t>(config.capacity) * shape.num_beams * sizeof(std::uint16_t)) {
  SLALOM_CHECK_GE(config.capacity, 2);
  SLALOM_CHECK_LT(config.capacity, std::numeric_limits<std::uint32_t>::max());
}

void Table::Insert(const Chunk& chunk) {
  SLALOM_CHECK(chunk.shape == shape_);
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
  auto* const numbers = reinterpret_cast<float*>(&here + 1);
  std::ranges::copy(row.frame.state, numbers);
  std::ranges::copy(row.action, numbers + shape_.state_size);
  here.reward = row.reward;
  here.cost = row.cost;
  here.to_previous = 0;
  here.to_next = 0;
  here.stream = row.stream;
  here.flags = row.flags;
  std::copy(
      row.frame.ranges_cm.begin(), row.frame.ranges_cm.end(),
      reinterpret_cast<std::uint16_t*>(scans_.data()) + SlotIndex(sequence) * shape_.num_beams);

  if (priorities_ && is_final) priorities_->Clear(SlotIndex(sequence));
  if (priorities_ && !is_final) priorities_->SetNew(SlotIndex(sequence));

  const std::int64_t previous = last_[stream];
  if (!is_first && previous >= first_sequence()) {
    here.to_previous = static_cast<std::uint32_t>(sequence - previous);
    slot(previous).to_next = here.to_previous;
  }
  last_[stream] = is_final ? kClosed : sequence;
}

std::optional<base::Failure> Table::CheckEpisodes(const RowBytes& rows, int stream_base) const {
  SLALOM_CHECK_GE(stream_base, 0);
  if (rows.shape() != shape_) {
    return base::Failure{
        fmt::format("rows have scans of {} beams, states of {} numbers and actions of {}, expected "
                    "{}, {} and {}",
                    rows.shape().num_beams, rows.shape().state_size, rows.shape().action_size,
                    shape_.num_beams, shape_.state_size, shape_.action_size)};
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
  SLALOM_CHECK(rows.shape() == shape_);
  SLALOM_CHECK_GE(stream_base, 0);
  for (int r = 0; r < rows.num_rows(); ++r) {
    RowView row = rows.row(r);
    row.stream += stream_base;
    InsertRow(row);
  }
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
          {{scan(sequence), static_cast<std::size_t>(shape_.num_beams)}, state(here)},
          action(here),
          here.reward,
          here.cost};
}

Table Table::BeginRestore(const ReplayConfig& config, const env::StepShape& shape,
                          std::int64_t start) {
  Table table(config, shape);
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

namespace {

// Number of samples whose links are followed side by side, so that their cache misses overlap.
constexpr int kWindowBlock = 64;
// Rounds of rejected draws after which the eligible steps are listed instead.
constexpr int kMaxRounds = 32;

}  // namespace

/// An n-step window while its links are followed.
struct Table::Window {
  enum class State : std::uint8_t { kOpen, kWhole, kRejected };

  std::int64_t begin = 0;
  std::int64_t cursor = 0;  ///< The step to be added next; when whole, the frame after the window.
  double reward = 0.0;
  double cost = 0.0;
  double discount = 1.0;
  State state = State::kOpen;
};

void Table::FollowWindows(const SampleSpec& spec, std::span<Window> windows) const {
  // Round k reads the row after k steps, for all windows before the next round: each row is a cache
  // miss, and only the row before it tells where it is.
  for (int k = 0; k <= spec.n_step; ++k) {
    for (Window& window : windows) {
      if (window.state != Window::State::kOpen) continue;
      const Slot& here = slot(window.cursor);
      if (k > 0 && (k == spec.n_step || (here.flags & kRowFinal))) {
        window.state = Window::State::kWhole;
        continue;
      }
      if ((here.flags & kRowFinal) || here.to_next == 0) {
        window.state = Window::State::kRejected;
        continue;
      }
      window.reward += window.discount * here.reward;
      window.cost += window.discount * here.cost;
      window.discount *= spec.gamma;
      window.cursor += here.to_next;
      if (here.flags & kRowTerminated) {
        window.discount = 0.0;
        window.state = Window::State::kWhole;
      }
      __builtin_prefetch(&slot(window.cursor));
    }
  }
}

bool Table::HasHistory(std::int64_t sequence, int history) const {
  for (int h = 1; h < history; ++h) {
    const Slot& here = slot(sequence);
    if (here.flags & kRowFirst) return true;
    if (here.to_previous == 0 || sequence - here.to_previous < first_sequence()) return false;
    sequence -= here.to_previous;
  }
  return true;
}

bool Table::IsEligible(std::int64_t sequence, const SampleSpec& spec) const {
  Window window{.begin = sequence, .cursor = sequence};
  FollowWindows(spec, std::span(&window, 1));
  return window.state == Window::State::kWhole && HasHistory(sequence, spec.history);
}

std::vector<std::int64_t> Table::ListEligible(const SampleSpec& spec) const {
  std::vector<std::int64_t> eligible;
  for (std::int64_t s = first_sequence(); s < total_; ++s) {
    if (IsEligible(s, spec)) eligible.push_back(s);
  }
  return eligible;
}

std::int64_t Table::CountEligible(int history, int n_step) const {
  return static_cast<std::int64_t>(
      ListEligible({.batch = 1, .history = history, .n_step = n_step}).size());
}

void Table::UsePriorities(double alpha) {
  if (priorities_) return;
  priorities_.emplace(config_.capacity, alpha);
  for (std::int64_t s = first_sequence(); s < total_; ++s) {
    if (!(slot(s).flags & kRowFinal)) priorities_->SetNew(SlotIndex(s));
  }
}

std::int64_t Table::SetPriorities(std::span<const std::int64_t> sequences,
                                  std::span<const float> priorities) {
  SLALOM_CHECK(priorities_.has_value());
  SLALOM_CHECK_EQ(sequences.size(), priorities.size());
  std::int64_t count = 0;
  for (std::size_t i = 0; i < sequences.size(); ++i) {
    const std::int64_t s = sequences[i];
    if (s < first_sequence() || s >= total_ || (slot(s).flags & kRowFinal)) continue;
    priorities_->Set(SlotIndex(s), priorities[i]);
    ++count;
  }
  return count;
}

void Table::DrawSequences(bool prioritized, base::Random& random,
                          std::span<std::int64_t> sequences) const {
  const std::int64_t first = first_sequence();
  if (!prioritized) {
    const auto rows = static_cast<std::uint64_t>(num_rows());
    for (std::int64_t& s : sequences)
      s = first + static_cast<std::int64_t>(random.UniformInt(rows));
    return;
  }
  priorities_->Draw(random, sequences);
  const std::int64_t first_slot = SlotIndex(first);
  for (std::int64_t& s : sequences) {
    s += first - first_slot + (s < first_slot ? config_.capacity : 0);
  }
}

void Table::DrawFrom(std::span<const std::int64_t> eligible, bool prioritized, base::Random& random,
                     std::span<std::int64_t> sequences) const {
  if (!prioritized) {
    for (std::int64_t& s : sequences) s = eligible[random.UniformInt(eligible.size())];
    return;
  }
  std::vector<double> sums;
  double sum = 0.0;
  for (const std::int64_t s : eligible) sums.push_back(sum += priorities_->weight(SlotIndex(s)));
  for (std::int64_t& s : sequences) {
    const auto it = std::upper_bound(sums.begin(), sums.end() - 1, random.Uniform() * sum);
    s = eligible[static_cast<std::size_t>(it - sums.begin())];
  }
}

void Table::DrawBlock(const SampleSpec& spec, base::Random& random, std::span<Window> windows,
                      int* num_drawn) const {
  *num_drawn = 0;
  if (spec.prioritized && !(priorities_->total() > 0.0)) return;
  std::array<std::int64_t, kWindowBlock> draws;
  int whole = 0;
  for (int round = 0; round < kMaxRounds && whole < static_cast<int>(windows.size()); ++round) {
    const std::span<Window> open = windows.subspan(whole);
    const std::span<std::int64_t> drawn(draws.data(), open.size());
    DrawSequences(spec.prioritized, random, drawn);
    for (std::size_t i = 0; i < open.size(); ++i) {
      open[i] = {.begin = drawn[i], .cursor = drawn[i]};
      __builtin_prefetch(&slot(drawn[i]));
    }
    FollowWindows(spec, open);
    for (const Window& window : open) {
      if (window.state == Window::State::kWhole && HasHistory(window.begin, spec.history)) {
        windows[whole++] = window;
      }
    }
  }
  *num_drawn = whole;
}

void Table::WriteWeights(double importance_exponent, SampledRows* rows) const {
  double smallest = 0.0;
  for (const std::int64_t s : rows->sequence) {
    const double weight = priorities_->weight(SlotIndex(s));
    smallest = smallest == 0.0 ? weight : std::min(smallest, weight);
  }
  for (std::size_t b = 0; b < rows->sequence.size(); ++b) {
    const double weight = priorities_->weight(SlotIndex(rows->sequence[b]));
    rows->weight[b] = static_cast<float>(std::pow(smallest / weight, importance_exponent));
  }
}

void Table::WriteHistory(std::int64_t sequence, int history, const std::uint16_t** ranges_cm,
                         float* state) const {
  for (int h = history - 1; h >= 0; --h) {
    const Slot& here = slot(sequence);
    ranges_cm[h] = scan(sequence);
    std::ranges::copy(this->state(here),
                      state + static_cast<std::ptrdiff_t>(h) * shape_.state_size);
    // The first frame of an episode links to itself, so that copies of it stand before it.
    sequence -= here.to_previous;
  }
}

bool Table::SampleRows(const SampleSpec& spec, base::Random& random, SampledRows* rows) const {
  SLALOM_CHECK(spec.batch >= 1 && spec.history >= 1 && spec.n_step >= 1);
  rows->Resize(spec.batch, spec.history, shape_);
  std::fill_n(rows->weight.data(), rows->weight.size(), 1.0f);
  SLALOM_CHECK(!spec.prioritized || priorities_.has_value());
  if (num_rows() == 0) return false;

  std::vector<std::int64_t> eligible;  // Listed only if draws keep being rejected.
  std::array<Window, kWindowBlock> block;
  for (int begin = 0; begin < spec.batch; begin += kWindowBlock) {
    const std::span<Window> windows(block.data(), std::min(kWindowBlock, spec.batch - begin));
    int num_drawn = 0;
    if (eligible.empty()) DrawBlock(spec, random, windows, &num_drawn);
    if (num_drawn < static_cast<int>(windows.size())) {
      if (eligible.empty()) eligible = ListEligible(spec);
      if (eligible.empty()) return false;
      const std::span<Window> rest = windows.subspan(num_drawn);
      std::array<std::int64_t, kWindowBlock> draws;
      DrawFrom(eligible, spec.prioritized, random, std::span(draws).first(rest.size()));
      for (std::size_t i = 0; i < rest.size(); ++i) {
        rest[i] = {.begin = draws[i], .cursor = draws[i]};
      }
      FollowWindows(spec, rest);
    }
    for (std::size_t i = 0; i < windows.size(); ++i) {
      const Window& window = windows[i];
      const std::size_t b = begin + i;
      const std::size_t frame = b * spec.history;
      rows->sequence[b] = window.begin;
      rows->next_sequence[b] = window.cursor;
      std::ranges::copy(action(slot(window.begin)), &rows->action[b * shape_.action_size]);
      rows->n_step_return[b] = static_cast<float>(window.reward);
      rows->cost_return[b] = static_cast<float>(window.cost);
      rows->discount[b] = static_cast<float>(window.discount);
      WriteHistory(window.begin, spec.history, &rows->ranges_cm[frame],
                   &rows->state[frame * shape_.state_size]);
      WriteHistory(window.cursor, spec.history, &rows->next_ranges_cm[frame],
                   &rows->next_state[frame * shape_.state_size]);
    }
  }
  if (spec.prioritized) WriteWeights(spec.importance_exponent, rows);
  return true;
}

std::int64_t Table::SequenceOf(const std::uint16_t* scan) const {
  const auto* const scans = reinterpret_cast<const std::uint16_t*>(scans_.data());
  const std::int64_t place = (scan - scans) / shape_.num_beams;
  const std::int64_t newest = total_ - 1;
  const std::int64_t round = newest / config_.capacity - (place > newest % config_.capacity);
  return round * config_.capacity + place;
}

bool Table::Sample(const SampleSpec& spec, base::Random& random, Batch* batch) const {
  if (!SampleRows(spec, random, &batch->rows)) return false;
  const std::size_t scans = batch->rows.ranges_cm.size();
  batch->ranges_cm.Resize(scans * shape_.num_beams);
  batch->next_ranges_cm.Resize(scans * shape_.num_beams);
  GatherScans(batch->rows.ranges_cm, shape_.num_beams, batch->ranges_cm.data());
  GatherScans(batch->rows.next_ranges_cm, shape_.num_beams, batch->next_ranges_cm.data());
  return true;
}

namespace {

static_assert(std::endian::native == std::endian::little, "the file is little-endian");

/// The header of the file; docs/replay.md specifies it byte by byte.
struct Head {
  char magic[8] = {'S', 'L', 'R', 'P', 'L', 'P', 'R', 'I'};
  std::uint32_t version = 1;
  std::uint32_t zero = 0;
  double alpha = 0.0;
  double largest = 0.0;
  std::int64_t first_row = 0;
  std::int64_t num_rows = 0;
};
static_assert(sizeof(Head) == 48);

constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);

}  // namespace

std::string Table::PrintPriorities() const {
  SLALOM_CHECK(priorities_.has_value());
  Head head;
  head.alpha = priorities_->alpha();
  head.largest = priorities_->largest();
  head.first_row = first_sequence();
  head.num_rows = num_rows();
  const auto num_rows = static_cast<std::size_t>(head.num_rows);
  std::string bytes(sizeof head + num_rows * sizeof(double) + kChecksumBytes, '\0');
  std::memcpy(bytes.data(), &head, sizeof head);
  char* out = bytes.data() + sizeof head;
  for (std::int64_t s = first_sequence(); s < total_; ++s, out += sizeof(double)) {
    const double weight = priorities_->weight(SlotIndex(s));
    std::memcpy(out, &weight, sizeof weight);
  }
  const std::uint64_t checksum =
      base::Checksum(std::string_view(bytes).substr(0, bytes.size() - kChecksumBytes));
  std::memcpy(out, &checksum, sizeof checksum);
  return bytes;
}

std::optional<base::Failure> Table::RestorePriorities(std::string_view bytes, double alpha) {
  SLALOM_CHECK(!priorities_.has_value());
  if (bytes.size() < sizeof(Head) + kChecksumBytes) return base::Failure{"it is cut short"};
  const std::string_view content = bytes.substr(0, bytes.size() - kChecksumBytes);
  std::uint64_t checksum = 0;
  std::memcpy(&checksum, bytes.data() + content.size(), sizeof checksum);
  if (checksum != base::Checksum(content)) return base::Failure{"its checksum is wrong"};
  Head head;
  std::memcpy(&head, bytes.data(), sizeof head);
  if (std::memcmp(head.magic, Head().magic, sizeof head.magic) != 0 ||
      head.version != Head().version) {
    return base::Failure{
        fmt::format("it is of version {}, expected {}", head.version, Head().version)};
  }
  if (head.alpha != alpha) {
    return base::Failure{
        fmt::format("it was made with priority exponent {}, expected {}", head.alpha, alpha)};
  }
  const std::size_t num_weights = (content.size() - sizeof head) / sizeof(double);
  std::vector<double> weights(num_weights);
  std::memcpy(weights.data(), bytes.data() + sizeof head, num_weights * sizeof(double));
  const auto is_weight = [](double w) { return w >= 0.0 && w <= Priorities::kLargest; };
  const bool sound = content.size() == sizeof head + num_weights * sizeof(double) &&
                     head.num_rows == static_cast<std::int64_t>(num_weights) &&
                     head.first_row >= 0 && head.largest >= 1.0 &&
                     head.largest <= Priorities::kLargest &&
                     std::ranges::all_of(weights, is_weight);
  if (!sound) return base::Failure{"its numbers are out of range"};

  priorities_.emplace(config_.capacity, alpha);
  priorities_->RaiseLargest(head.largest);
  for (std::int64_t s = first_sequence(); s < total_; ++s) {
    if (slot(s).flags & kRowFinal) continue;
    // The journal may hold more rows, or other rows in place of a tail that was truncated.
    const std::int64_t i = s - head.first_row;
    const double weight = i >= 0 && i < head.num_rows ? weights[static_cast<std::size_t>(i)] : 0.0;
    if (weight > 0.0) {
      priorities_->RestoreWeight(SlotIndex(s), weight);
    } else {
      priorities_->SetNew(SlotIndex(s));
    }
  }
  return std::nullopt;
}

}  // namespace slalom::replay
