#pragma once

#include <cstdint>
#include <string_view>

namespace slalom::env {

/// How an episode stands or ended.
enum class Outcome : std::uint8_t { kRunning, kSuccess, kCollision, kTimeout };

std::string_view ToString(Outcome outcome);

/// What one control step gave. A value.
struct StepResult {
  float reward = 0.0f;  ///< Equation 1 of the paper.
  float cost = 0.0f;    ///< 1 where this step collided (safe RL), else 0.
  Outcome outcome = Outcome::kRunning;

  bool ended() const { return outcome != Outcome::kRunning; }
  /// The state itself is final: no value beyond it. A time limit is not (truncation: bootstrap).
  bool terminated() const { return outcome == Outcome::kSuccess || outcome == Outcome::kCollision; }
};

/// What makes an episode: with the same spec, config and actions it is the same, bit for bit.
struct EpisodeSpec {
  int course = 0;          ///< Index in the environment's list of courses.
  std::uint64_t seed = 0;  ///< Of start pose, sensor noise and everything else that is drawn.
};

}  // namespace slalom::env
