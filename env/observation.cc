#include "env/observation.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::env {

void WriteMotion(const ObservationSpec& spec, std::span<const Action> actions, Action speeds,
                 base::Vec2 mounting, std::span<float> state) {
  SLALOM_CHECK_EQ(actions.size(), static_cast<std::size_t>(spec.commands));
  SLALOM_CHECK_EQ(state.size(), static_cast<std::size_t>(spec.course_state_size()));
  // All after the goal are pairs, up to what is privileged.
  const std::size_t size = state.size() - static_cast<std::size_t>(spec.privileged_size());
  const std::span<Action> pairs = AsActions(state.first(size).subspan(2));
  pairs.front() = actions.front();
  std::size_t next = 1;
  if (spec.speeds) pairs[next++] = speeds;
  if (spec.mounting) {
    pairs[next] = {static_cast<float>(10.0 * mounting.x), static_cast<float>(10.0 * mounting.y)};
  }
  std::ranges::copy(actions.subspan(1), pairs.last(actions.size() - 1).begin());
}

void WriteObservation(const ObservationSpec& spec, const FrameView& frame,
                      std::span<float> observation) {
  SLALOM_CHECK_EQ(frame.ranges_cm.size(), static_cast<std::size_t>(spec.num_beams));
  SLALOM_CHECK_EQ(observation.size(), static_cast<std::size_t>(spec.size()));
  const float clip_cm = static_cast<float>(100.0 * spec.range_clip);
  for (int i = 0; i < spec.num_beams; ++i) {
    const float range = std::min(static_cast<float>(frame.ranges_cm[i]), clip_cm);
    observation[i] = range * (2.0f / clip_cm) - 1.0f;
  }
  const float goal_scale = static_cast<float>(spec.goal_scale);
  const auto rest = observation.subspan(spec.num_beams);
  rest[0] = frame.state[0] / goal_scale - 1.0f;
  rest[1] = frame.state[1] / goal_scale - 1.0f;
  std::ranges::copy(frame.state.subspan(2), rest.begin() + 2);
}

}  // namespace slalom::env
