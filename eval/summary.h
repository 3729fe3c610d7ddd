#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "eval/episodes.h"
#include "eval/statistics.h"
#include "sim/course.h"
#include "sim/environment_config.h"

namespace slalom::eval {

/// The figures of a group of episodes.
struct Figures {
  int num_episodes = 0;
  int num_successes = 0;
  int num_collisions = 0;
  int num_timeouts = 0;
  Estimate success_rate;
  Estimate collision_rate;
  Estimate timeout_rate;
  std::optional<Estimate> survival_time;   ///< Of failed episodes (collision or time limit), [s].
  std::optional<Estimate> traversal_time;  ///< Of successful episodes, [s].
  Estimate barn_score;                     ///< Mean of `BarnScore`, 0 to 0.5.
  double mean_return = 0.0;
  double mean_path_length = 0.0;  ///< [m]
};

/// The figures of one course.
struct CourseFigures {
  int course = 0;  ///< Index in the course set.
  std::string name;
  double optimal_time = 0.0;  ///< Reference length over 2 m/s, [s].
  Figures figures;
};

/// The figures of a whole set and of each course in it, in the set's order.
struct Summary {
  Figures set;
  std::vector<CourseFigures> courses;
};

/// Time of the reference path at 2 m/s, [s].
double OptimalTime(const sim::Course& course);

/// The BARN Challenge's score of one episode: optimal_time / clip(time, 2 optimal_time, 8
/// optimal_time) for a success, else 0; so at most 0.5. Times in [s].
double BarnScore(env::Outcome outcome, double time, double optimal_time);

/// `clock` says what a step lasts and when an episode times out.
/// Requires: every course has at least one record; all episodes have ended.
Summary Summarise(std::span<const EpisodeRecord> records, const sim::CourseSet& courses,
                  const sim::EpisodeConfig& clock);

}  // namespace slalom::eval
