#include "replay/batch.h"

#include <algorithm>
#include <cstring>

namespace slalom::replay {

void SampledRows::Resize(int new_batch, int new_history, const env::StepShape& new_shape) {
  batch = new_batch;
  history = new_history;
  shape = new_shape;
  const auto samples = static_cast<std::size_t>(batch);
  const std::size_t frames = samples * static_cast<std::size_t>(history);
  ranges_cm.resize(frames);
  next_ranges_cm.resize(frames);
  state.Resize(frames * shape.state_size);
  next_state.Resize(frames * shape.state_size);
  action.Resize(samples * shape.action_size);
  n_step_return.Resize(samples);
  cost_return.Resize(samples);
  discount.Resize(samples);
  weight.Resize(samples);
  sequence.resize(samples);
  next_sequence.resize(samples);
}

namespace {

constexpr int kCacheLine = 64;
// Number of scans that are prefetched ahead of the one being copied.
constexpr int kScansAhead = 3;

void PrefetchScan(const std::uint16_t* scan, int num_beams) {
  const char* const bytes = reinterpret_cast<const char*>(scan);
  for (std::size_t i = 0; i < num_beams * sizeof(std::uint16_t); i += kCacheLine) {
    __builtin_prefetch(bytes + i);
  }
}

}  // namespace

void GatherScans(std::span<const std::uint16_t* const> scans, int num_beams, std::uint16_t* out) {
  if (num_beams == 0) return;
  const std::size_t n = scans.size();
  for (std::size_t i = 0; i < std::min<std::size_t>(kScansAhead, n); ++i) {
    PrefetchScan(scans[i], num_beams);
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (i + kScansAhead < n) PrefetchScan(scans[i + kScansAhead], num_beams);
    std::memcpy(out + i * num_beams, scans[i], num_beams * sizeof(std::uint16_t));
  }
}

}  // namespace slalom::replay
