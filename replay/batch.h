#pragma once

#include <cstdint>
#include <vector>

#include "env/action.h"
#include "env/observation.h"
#include "replay/lazy_memory.h"

/// Shapes: `B` samples, `H` frames of history (the newest last), `N` beams, `S` = env::kStateSize.

namespace slalom::replay {

/// What to sample.
struct SampleSpec {
  int batch = 128;                   ///< B
  int history = 1;                   ///< H
  int n_step = 1;                    ///< Longest window of a return, in steps.
  double gamma = 0.99;               ///< Discount per step.
  bool prioritized = false;          ///< Draw in proportion to the rows' weights.
  double importance_exponent = 0.0;  ///< beta of the importance weights, where prioritized.
};

/// B transitions drawn from a `Table`, with the scans left where they lie: a reader that pools or
/// converts them saves a copy. Reused from call to call, so nothing is allocated after the first.
///
/// A window starts at the step that was drawn and is k <= n_step steps long: less where its episode
/// ended.
struct SampledRows {
  int batch = 0;
  int history = 0;
  int num_beams = 0;
  std::vector<const std::uint16_t*>
      ranges_cm;                       ///< [B, H] -> [N] [cm], valid until the next `Insert`
  AlignedBuffer<float> state;          ///< [B, H, S]
  AlignedBuffer<env::Action> action;   ///< [B], as floats [B, 2]: linear, angular
  AlignedBuffer<float> n_step_return;  ///< [B], sum over i < k of gamma^i reward_i
  AlignedBuffer<float> cost_return;    ///< [B], the same of the costs
  AlignedBuffer<float> discount;       ///< [B], gamma^k, or 0 where the window terminated
  AlignedBuffer<float> weight;         ///< [B], importance of the sample; 1 where draws are uniform
  std::vector<const std::uint16_t*> next_ranges_cm;  ///< [B, H] -> [N] [cm], after the window
  AlignedBuffer<float> next_state;                   ///< [B, H, S]

  /// Where each sample stands, in rows ever inserted: [B] the step drawn and the frame after its
  /// window.
  std::vector<std::int64_t> sequence;
  std::vector<std::int64_t> next_sequence;

  /// Gives every array its size.
  void Resize(int new_batch, int new_history, int new_num_beams);
};

/// As `SampledRows`, with the scans gathered.
struct Batch {
  SampledRows rows;
  AlignedBuffer<std::uint16_t> ranges_cm;       ///< [B, H, N] [cm]
  AlignedBuffer<std::uint16_t> next_ranges_cm;  ///< [B, H, N] [cm]
};

}  // namespace slalom::replay
