#pragma once

#include <optional>

#include "eval/report/result.h"
#include "eval/statistics/statistics.h"

namespace slalom::eval {

/// The differences between two agents on the same courses, `first` minus `second`. A value.
///
/// Differences are taken course by course, so how hard a course is cancels out: the 95 % intervals
/// are narrower than the intervals of the agents' own scores, and tell which agent is better on
/// further courses of the same kind. Every course has the same weight. There is no interval if
/// there are fewer than two courses, or if all of them show exactly the same difference, so that
/// the spread is not known.
struct PairedComparison {
  Estimate success_rate;                   ///< -1 to 1.
  Estimate collision_rate;                 ///< Episodes that a collision ended; -1 to 1.
  Estimate timeout_rate;                   ///< -1 to 1.
  std::optional<Estimate> traversal_time;  ///< [s]; empty if both passed no common course.
  Estimate barn_score;                     ///< -0.5 to 0.5.
  int num_traversal_courses = 0;           ///< Courses that both passed at least once.
  /// Whether episodes of the same number on a course began at the same place (equal seeds and
  /// equally many episodes), so that they can be compared one by one.
  bool same_starts = false;
};

/// Compares two agents. Requires: results of one protocol on the same courses (one group of
/// `GroupByCourses`).
PairedComparison CompareInPairs(const Result& first, const Result& second);

}  // namespace slalom::eval
