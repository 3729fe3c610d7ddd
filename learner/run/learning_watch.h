#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "learner/run/metrics_log.h"

namespace slalom::run {

/// Recognises from the rows of a run that learning is dead, and warns once for each reason:
///
/// - The actor's or the critics' gradient was exactly 0 for `kStillUpdates` updates in a row. A
///   network whose activations are saturated or dead has no gradient and never gets one again;
///   learning rates that are far too high do this. In a healthy run a gradient is small, not 0.
/// - Half of the run is over, and none of the training episodes, at least `kEpisodes` of them,
/// reached its goal. A slow start looks the same for a long time, so this is not a proof.
///
/// If episodes have no goal, as in an environment of one's own, the second reason is left out, and
/// no run has certainly learned nothing.
///
/// A value; thread-compatible.
class LearningWatch {
 public:
  static constexpr std::int64_t kStillUpdates = 1000;
  static constexpr std::int64_t kEpisodes = 200;

  /// The state that a resumed session needs from earlier sessions: updates since the last gradient
  /// that was not 0, of the actor and of the critics, and whether a training episode has reached
  /// its goal (1) or not (0).
  using State = std::array<std::int64_t, 3>;

  explicit LearningWatch(bool has_goals = true, const State& state = {})
      : actor_still_updates_(state[0]),
        critic_still_updates_(state[1]),
        has_succeeded_(state[2] != 0 || !has_goals) {}
  State state() const { return {actor_still_updates_, critic_still_updates_, has_succeeded_}; }

  /// Takes the next row. `fraction`: part of the run that is done, 0 to 1. Returns a warning if
  /// there is a reason for one that was not given before.
  std::optional<std::string> Observe(const MetricsRow& row, double fraction);

  /// Returns a sentence about what is wrong as of the last row, or an empty text.
  std::string fault() const;

  /// Returns whether the run has certainly learned nothing: a network has no gradient, and no
  /// training episode has reached its goal.
  bool nothing_learned() const;

 private:
  bool is_actor_still() const { return actor_still_updates_ >= kStillUpdates; }
  bool is_critic_still() const { return critic_still_updates_ >= kStillUpdates; }

  std::optional<MetricsRow> first_;
  MetricsRow last_;
  double fraction_ = 0.0;
  std::int64_t actor_still_updates_ = 0;  // Updates since the last gradient that was not 0.
  std::int64_t critic_still_updates_ = 0;
  bool has_succeeded_;  // Or there is no goal.
  std::string said_;    // The last warning.
};

}  // namespace slalom::run
