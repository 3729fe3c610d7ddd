#pragma once

#include <cstdint>
#include <string_view>

namespace slalom::env {

/// Whether an episode is running, or how it ended.
enum class Outcome : std::uint8_t {
  kRunning,
  kSuccess,
  kCollision,
  kTimeout,
  kTerminated,  ///< In a final state that is neither success nor collision: not on a course.
};
inline constexpr int kNumOutcomes = 5;

std::string_view ToString(Outcome outcome);

/// The result of a control step. A value.
struct StepResult {
  float reward = 0.0f;  ///< Equation 1 of the paper (Xu et al., section III-C).
  float cost = 0.0f;    ///< 1 if the robot collided in this step, else 0 (safe RL).
  Outcome outcome = Outcome::kRunning;

  bool ended() const { return outcome != Outcome::kRunning; }
  /// Whether the state is final, so that no value lies beyond it. The state at a time limit is not
  /// final (a truncation): learning bootstraps from it.
  bool terminated() const { return ended() && outcome != Outcome::kTimeout; }
};

/// Course and seed of an episode. The same spec, config and actions give the same episode, bit for
/// bit.
struct EpisodeSpec {
  int course = 0;          ///< Index in the environment's list of courses.
  std::uint64_t seed = 0;  ///< Seeds the start pose, sensor noise and all other draws.
};

}  // namespace slalom::env
