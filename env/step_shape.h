#pragma once

#include "env/action.h"
#include "env/observation.h"

namespace slalom::env {

/// The longest state and action.
inline constexpr int kMaxStateSize = 4096;
inline constexpr int kMaxActionSize = 256;

/// The sizes of what is observed and commanded in a step. A value.
struct StepShape {
  /// Of a course whose scans have `beams`, unless the others are given.
  constexpr StepShape(int beams = 0, int state = kStateSize, int action = kActionSize)
      : num_beams(beams), state_size(state), action_size(action) {}

  int num_beams;    ///< N, beams of the scan; 0 if there is none.
  int state_size;   ///< S, numbers of a frame besides the scan, 1 to kMaxStateSize.
  int action_size;  ///< A, numbers of an action, 1 to kMaxActionSize.

  friend bool operator==(const StepShape&, const StepShape&) = default;
};

}  // namespace slalom::env
