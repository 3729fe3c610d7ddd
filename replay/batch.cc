#include "replay/batch.h"

namespace slalom::replay {

void SampledRows::Resize(int new_batch, int new_history, int new_num_beams) {
  batch = new_batch;
  history = new_history;
  num_beams = new_num_beams;
  const auto samples = static_cast<std::size_t>(batch);
  const std::size_t frames = samples * static_cast<std::size_t>(history);
  ranges_cm.resize(frames);
  next_ranges_cm.resize(frames);
  state.Resize(frames * env::kStateSize);
  next_state.Resize(frames * env::kStateSize);
  action.Resize(samples);
  n_step_return.Resize(samples);
  cost_return.Resize(samples);
  discount.Resize(samples);
  weight.Resize(samples);
  sequence.resize(samples);
  next_sequence.resize(samples);
}

}  // namespace slalom::replay
