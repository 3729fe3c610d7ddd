#pragma once

#include <algorithm>

#include "env/observation.h"
#include "tests/learner/random_rows.h"

namespace slalom::learner {

/// A world whose one-step transitions are known: two numbers x and y stand where the goal does,
/// ranges stay as they are, and
///
///     x' = 0.9 x + 0.3 linear + N(0, kNoiseX),   y' = y - 0.2 angular + N(0, kNoiseY),
///     reward = x' - 0.5 angular (without the noise), terminated where y > 0.5.
///
/// As features x = state[0] / 5 - 1 and y likewise.
struct LinearWorld {
  static constexpr int kBeams = 4;
  static constexpr double kNoiseX = 0.1;
  static constexpr double kNoiseY = 0.02;

  /// Transitions of random states and actions; sequence numbers go on from `begin`.
  static void Fill(std::uint64_t seed, std::int64_t begin, RandomRows& random_rows) {
    replay::SampledRows& rows = random_rows.rows;
    base::Random random(seed);
    for (int i = 0; i < rows.batch; ++i) {
      rows.sequence[i] = begin + i;
      const env::Action action{rows.action[2 * i], rows.action[2 * i + 1]};
      const double x = random.Uniform(-1.0, 1.0);
      const double y = random.Uniform(-1.0, 1.0);
      const double mean_x = 0.9 * x + 0.3 * static_cast<double>(action.linear);
      const double mean_y = y - 0.2 * static_cast<double>(action.angular);
      Write(x, y, &rows.state[static_cast<std::size_t>(i) * env::kStateSize]);
      float* const next = &rows.next_state[static_cast<std::size_t>(i) * env::kStateSize];
      Write(mean_x + kNoiseX * random.Normal(), mean_y + kNoiseY * random.Normal(), next);
      next[2] = action.linear;
      next[3] = action.angular;
      std::copy_n(rows.ranges_cm[i], kBeams,
                  random_rows.next_scans.data() + static_cast<std::size_t>(i) * kBeams);
      rows.n_step_return[i] =
          static_cast<float>(mean_x - 0.5 * static_cast<double>(action.angular));
      rows.discount[i] = y > 0.5 ? 0.0f : 1.0f;
    }
  }

 private:
  static void Write(double x, double y, float* state) {
    state[0] = static_cast<float>(5.0 * (x + 1.0));
    state[1] = static_cast<float>(5.0 * (y + 1.0));
  }
};

}  // namespace slalom::learner
