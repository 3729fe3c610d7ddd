#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "env/agent.h"

namespace slalom::testing {

/// Drives towards the goal and turns away from the nearer side: reaches the goal on easy courses,
/// collides on others, so that tests on real courses see both. Without memory.
class ReactiveAgent : public env::Agent {
 public:
  void Act(const env::ObservationBatch& observations, std::span<float> numbers) override {
    const auto actions = env::AsActions(numbers);
    for (int i = 0; i < observations.batch_size; ++i) {
      const env::FrameView frame = observations.frame(i);
      const auto nearest = [&](std::size_t from, std::size_t to) {
        const auto part = frame.ranges_cm.subspan(from, to - from);
        return 0.01f * static_cast<float>(*std::min_element(part.begin(), part.end()));
      };
      const std::size_t n = frame.ranges_cm.size();
      const float right = nearest(n / 4, n / 2);
      const float left = nearest(n / 2, n - n / 4);
      const float bearing = std::atan2(frame.state[1], frame.state[0]);
      const float ahead = std::min(left, right);
      actions[i].linear = std::clamp(ahead - 0.6f, -0.3f, 0.5f);
      actions[i].angular =
          std::clamp(0.3f * bearing + 0.25f * (1.0f / right - 1.0f / left), -1.0f, 1.0f);
    }
  }
};

}  // namespace slalom::testing
