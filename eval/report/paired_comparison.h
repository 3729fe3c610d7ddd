#pragma once

#include <optional>

#include "eval/report/result.h"
#include "eval/statistics/statistics.h"

namespace slalom::eval {

/// How far two agents differ on the same courses, `first` minus `second`. A value.
///
/// Differences are taken course by course, so how hard a course is cancels out: the 95 % intervals
/// are narrower than those of the agents' own scores, and say which agent is better on further
/// courses of the same kind. Every course has the same weight. There is no interval if there are
/// fewer than two courses, or if all of them show exactly the same difference, so that the spread
/// is not known.
struct PairedComparison {
  Estimate success_rate;                   ///< -1 to 1.
  Estimate collision_rate;                 ///< Of episodes that a collision ended; -1 to 1.
  Estimate timeout_rate;                   ///< -1 to 1.
  std::optional<Estimate> traversal_time;  ///< [s]; none: no course was passed by both.
  Estimate barn_score;                     ///< -0.5 to 0.5.
  int num_traversal_courses = 0;           ///< Courses that both passed at least once.
  /// Episodes of the same number on a course began at the same place, so they can be compared one
  /// by one: equal seeds and equally many episodes.
  bool same_starts = false;
};

/// Requires: results of one protocol on the same courses (one group of `GroupByCourses`).
PairedComparison CompareInPairs(const Result& first, const Result& second);

}  // namespace slalom::eval
