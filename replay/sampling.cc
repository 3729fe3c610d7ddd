#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/check.h"
#include "replay/gather.h"
#include "replay/table.h"

namespace slalom::replay {
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
    std::copy_n(here.state, env::kStateSize, state + h * env::kStateSize);
    // The first frame of an episode links to itself, so that copies of it stand before it.
    sequence -= here.to_previous;
  }
}

bool Table::SampleRows(const SampleSpec& spec, base::Random& random, SampledRows* rows) const {
  SLALOM_CHECK(spec.batch >= 1 && spec.history >= 1 && spec.n_step >= 1);
  rows->Resize(spec.batch, spec.history, num_beams_);
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
      rows->action[b] = slot(window.begin).action;
      rows->n_step_return[b] = static_cast<float>(window.reward);
      rows->cost_return[b] = static_cast<float>(window.cost);
      rows->discount[b] = static_cast<float>(window.discount);
      WriteHistory(window.begin, spec.history, &rows->ranges_cm[frame],
                   &rows->state[frame * env::kStateSize]);
      WriteHistory(window.cursor, spec.history, &rows->next_ranges_cm[frame],
                   &rows->next_state[frame * env::kStateSize]);
    }
  }
  if (spec.prioritized) WriteWeights(spec.importance_exponent, rows);
  return true;
}

bool Table::Sample(const SampleSpec& spec, base::Random& random, Batch* batch) const {
  if (!SampleRows(spec, random, &batch->rows)) return false;
  const std::size_t scans = batch->rows.ranges_cm.size();
  batch->ranges_cm.Resize(scans * num_beams_);
  batch->next_ranges_cm.Resize(scans * num_beams_);
  GatherScans(batch->rows.ranges_cm, num_beams_, batch->ranges_cm.data());
  GatherScans(batch->rows.next_ranges_cm, num_beams_, batch->next_ranges_cm.data());
  return true;
}

}  // namespace slalom::replay
