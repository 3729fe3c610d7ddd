#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "eval/episodes.h"
#include "eval/statistics/statistics.h"
#include "sim/courses/course.h"

namespace slalom::eval {

/// The statistics of a group of episodes.
struct Figures {
  int num_episodes = 0;
  int num_successes = 0;
  int num_collisions = 0;
  int num_timeouts = 0;
  Estimate success_rate;
  Estimate collision_rate;
  Estimate timeout_rate;
  Estimate contact_rate;  ///< Share of episodes with a collision, whether it ended them or not.
  int num_contacts = 0;   ///< Sum of `EpisodeRecord::num_collisions`.
  std::optional<Estimate> survival_time;   ///< Mean over failed episodes (collision, timeout), [s].
  std::optional<Estimate> traversal_time;  ///< Mean over successful episodes, [s].
  Estimate barn_score;                     ///< Mean of `BarnScore`, 0 to 0.5.
  Estimate barn_score_until_2024;          ///< The same with its older lower limit, 0 to 0.25.
  double mean_return = 0.0;
  double mean_path_length = 0.0;  ///< [m]
};

/// The statistics of one course.
struct CourseFigures {
  int course = 0;  ///< Index in the course set.
  std::string name;
  double optimal_time = 0.0;  ///< Reference length over 2 m/s, [s].
  Figures figures;
};

/// The statistics of a whole set and of each of its courses, in the set's order.
struct Summary {
  Figures set;
  std::vector<CourseFigures> courses;
};

/// Returns the time of the reference path at 2 m/s, [s].
double OptimalTime(const sim::Course& course);

/// Lower limits of the time in `BarnScore`, in optimal times: today's, and the limit of 2022 to
/// 2024.
inline constexpr double kBarnLimit = 2.0;
inline constexpr double kBarnLimitUntil2024 = 4.0;

/// Returns the BARN Challenge's score of one episode: optimal_time / clip(time, lower_limit
/// optimal_time, 8 optimal_time) for a success, else 0; so at most 1 / lower_limit. Times in [s].
double BarnScore(env::Outcome outcome, double time, double optimal_time,
                 double lower_limit = kBarnLimit);

/// Computes the statistics of `records`. `step`: control step, [s]. `time_limit`: when an episode
/// times out, [s]. Requires: every course has at least one record; all episodes have ended.
Summary Summarise(std::span<const EpisodeRecord> records, const sim::CourseSet& courses,
                  double step, double time_limit);

}  // namespace slalom::eval
