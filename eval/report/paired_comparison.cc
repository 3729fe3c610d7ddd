#include "eval/report/paired_comparison.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "base/check.h"

namespace slalom::eval {
namespace {

/// Means over the episodes of one course. A time is none without a success.
struct CourseMeans {
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double barn_score = 0.0;
  std::optional<double> traversal_time;
};

CourseMeans MeansOf(const ResultCourse& course) {
  double num_successes = 0.0;
  double num_collisions = 0.0;
  double num_timeouts = 0.0;
  double time = 0.0;
  double score = 0.0;
  for (const ResultEpisode& episode : course.episodes) {
    score += BarnScore(episode.outcome, episode.time, course.optimal_time);
    if (episode.outcome == env::Outcome::kCollision) ++num_collisions;
    if (episode.outcome == env::Outcome::kTimeout) ++num_timeouts;
    if (episode.outcome != env::Outcome::kSuccess) continue;
    ++num_successes;
    time += episode.time;
  }
  const double num_episodes = std::max<double>(1.0, static_cast<double>(course.episodes.size()));
  CourseMeans means{num_successes / num_episodes, num_collisions / num_episodes,
                    num_timeouts / num_episodes, score / num_episodes, std::nullopt};
  if (num_successes > 0.0) means.traversal_time = time / num_successes;
  return means;
}

/// The mean of one difference per course. Empty if there is no course.
std::optional<Estimate> MeanDifference(const std::vector<double>& differences) {
  std::vector<CourseTotal> totals;
  totals.reserve(differences.size());
  for (const double difference : differences) totals.push_back({difference, 1.0});
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  auto estimate = EstimateMean(totals, {-kInfinity, kInfinity});
  if (!estimate) return std::nullopt;
  const auto [least, most] = std::ranges::minmax(differences);
  if (most - least < 1e-12) estimate->interval.reset();
  return estimate;
}

Estimate Within(Estimate estimate, double limit) {
  if (estimate.interval) {
    estimate.interval->low = std::max(estimate.interval->low, -limit);
    estimate.interval->high = std::min(estimate.interval->high, limit);
  }
  return estimate;
}

}  // namespace

PairedComparison CompareInPairs(const Result& first, const Result& second) {
  SLALOM_CHECK_EQ(first.courses.size(), second.courses.size());
  SLALOM_CHECK(!first.courses.empty());
  PairedComparison comparison;
  comparison.same_starts = first.seed == second.seed;
  std::vector<double> successes;
  std::vector<double> collisions;
  std::vector<double> timeouts;
  std::vector<double> scores;
  std::vector<double> times;
  for (std::size_t c = 0; c < first.courses.size(); ++c) {
    const CourseMeans a = MeansOf(first.courses[c]);
    const CourseMeans b = MeansOf(second.courses[c]);
    successes.push_back(a.success_rate - b.success_rate);
    collisions.push_back(a.collision_rate - b.collision_rate);
    timeouts.push_back(a.timeout_rate - b.timeout_rate);
    scores.push_back(a.barn_score - b.barn_score);
    if (a.traversal_time && b.traversal_time)
      times.push_back(*a.traversal_time - *b.traversal_time);
    if (first.courses[c].episodes.size() != second.courses[c].episodes.size()) {
      comparison.same_starts = false;
    }
  }
  comparison.success_rate = Within(*MeanDifference(successes), 1.0);
  comparison.collision_rate = Within(*MeanDifference(collisions), 1.0);
  comparison.timeout_rate = Within(*MeanDifference(timeouts), 1.0);
  comparison.barn_score = Within(*MeanDifference(scores), 1.0 / kBarnLimit);
  comparison.traversal_time = MeanDifference(times);
  comparison.num_traversal_courses = static_cast<int>(times.size());
  return comparison;
}

}  // namespace slalom::eval
