#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "env/step_shape.h"
#include "replay/lazy_memory.h"

/// Shapes: `B` samples, `H` frames of history (the newest last), and `N`, `S` and `A` of
/// `env::StepShape`.

namespace slalom::replay {

/// A request for samples.
struct SampleSpec {
  int batch = 128;                   ///< B
  int history = 1;                   ///< H
  int n_step = 1;                    ///< Longest window of a return, in steps.
  double gamma = 0.99;               ///< Discount per step.
  bool prioritized = false;          ///< Draw in proportion to the rows' weights.
  double importance_exponent = 0.0;  ///< beta of the importance weights, if prioritized.
};

/// B transitions drawn from a `Table`. The scans are pointers into the table, which saves a copy
/// for readers that pool or convert them. Reuse one object from call to call, so that only the
/// first call allocates.
///
/// A sample's n-step window starts at the step that was drawn. It has k steps: n_step, or fewer if
/// its episode ended before.
struct SampledRows {
  int batch = 0;
  int history = 0;
  env::StepShape shape;
  std::vector<const std::uint16_t*>
      ranges_cm;                       ///< [B, H] -> [N] [cm], valid until the next `Insert`
  AlignedBuffer<float> state;          ///< [B, H, S]
  AlignedBuffer<float> action;         ///< [B, A]
  AlignedBuffer<float> n_step_return;  ///< [B], sum over i < k of gamma^i reward_i
  AlignedBuffer<float> cost_return;    ///< [B], the same sum over the costs
  AlignedBuffer<float> discount;       ///< [B], gamma^k, or 0 if the window terminated
  AlignedBuffer<float> weight;         ///< [B], importance weight; 1 if draws are uniform
  std::vector<const std::uint16_t*> next_ranges_cm;  ///< [B, H] -> [N] [cm], after the window
  AlignedBuffer<float> next_state;                   ///< [B, H, S]

  /// Row numbers of each sample, [B]: the step that was drawn, and the frame after its window.
  std::vector<std::int64_t> sequence;
  std::vector<std::int64_t> next_sequence;

  /// Resizes every array.
  void Resize(int new_batch, int new_history, const env::StepShape& new_shape);
};

/// `SampledRows` with the scans copied into arrays.
struct Batch {
  SampledRows rows;
  AlignedBuffer<std::uint16_t> ranges_cm;       ///< [B, H, N] [cm]
  AlignedBuffer<std::uint16_t> next_ranges_cm;  ///< [B, H, N] [cm]
};

/// Copies scans to `out`, [scans.size(), num_beams]. Each scan is prefetched some scans ahead.
void GatherScans(std::span<const std::uint16_t* const> scans, int num_beams, std::uint16_t* out);

}  // namespace slalom::replay
