#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "env/agent.h"
#include "env/environment.h"
#include "env/episode.h"
#include "eval/evaluation_task.h"
#include "sim/courses/course.h"
#include "sim/courses/episode_file.h"

namespace slalom::eval {

/// One episode of an evaluation. A value.
struct EpisodeRecord {
  int course = 0;          ///< Index in the course set.
  int episode = 0;         ///< 0 ... episodes_per_course - 1.
  std::uint64_t seed = 0;  ///< The seed in its `EpisodeSpec`.
  env::Outcome outcome = env::Outcome::kRunning;
  int num_steps = 0;         ///< Control steps until it ended.
  int clock_start_step = 0;  ///< Steps before the protocol's clock started.
  /// How often a contact began, as seen at control steps: two within one step count once.
  int num_collisions = 0;
  int num_interventions = 0;    ///< Actions that a guard changed (`env::Agent::Intervened`).
  double path_length = 0.0;     ///< Driven, along the poses at the control steps, [m].
  double min_range = 0.0;       ///< Smallest range that the LiDAR reported, [m].
  double episode_return = 0.0;  ///< Sum of rewards, not discounted.
  std::string agent_status;     ///< `env::Agent::Status` when it ended.
  /// Values of the task's randomised fields (`sim::RandomizedConfig::values`). Empty without any.
  std::vector<double> drawn{};

  /// On the protocol's clock, [s]. `step`: control step, [s].
  double time(double step) const { return (num_steps - clock_start_step) * step; }

  friend bool operator==(const EpisodeRecord&, const EpisodeRecord&) = default;
};

/// All episodes of an evaluation, ordered by course, then episode.
struct Episodes {
  std::vector<EpisodeRecord> records;
  /// Tracks of `Recording::episodes_per_course` episodes of each course, in the same order: the
  /// first failures and, if there are too few, the first successes.
  std::vector<sim::EpisodeTrack> tracks;
};

/// Progress of an evaluation.
struct EpisodeCount {
  int all = 0;  ///< Episodes to be driven.
  int ended = 0;
  int successes = 0;
  int collisions = 0;  ///< Episodes with one, whether it ended them or not.
};

/// Called after each control step.
using Progress = std::function<void(const EpisodeCount&)>;

/// Returns the seed of one evaluation episode. It depends on the course's name, not on its index,
/// so that a course has the same starts and the same noise in every set, and two policies are
/// compared on equal terms. The purpose "evaluation" keeps it apart from every training stream of
/// the same root seed.
std::uint64_t EvaluationSeed(std::int64_t root_seed, const sim::Course& course, int episode);

/// Drives `episodes_per_course` episodes on each course and records them. Returns nothing if `stop`
/// was requested before the end: the episodes that end early are the short ones, so a partial
/// result would mislead.
///
/// If the protocol's clock starts late, an episode times out at its time limit on that clock, or if
/// the robot has not set off within the time limit.
///
/// The records do not depend on the batch size or the threads of `environments`, provided that the
/// agent chooses the action of each environment without regard to the others.
/// Throws `base::Error` if the agent chooses an action that is not finite.
/// Requires: `environments` are of the task's config and courses, and there is at least one course.
[[nodiscard]] std::optional<Episodes> RunEpisodes(const EvaluationTask& task,
                                                  env::BatchEnvironment& environments,
                                                  env::Agent& agent, const Progress& progress = {},
                                                  std::stop_token stop = {});

}  // namespace slalom::eval
