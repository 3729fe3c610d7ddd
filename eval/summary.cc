#include "eval/summary.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::eval {
namespace {

constexpr double kReferenceSpeed = 2.0;  // [m/s]
constexpr double kHighestBarnLimit = 8.0;

/// The totals of one course's episodes for each statistic.
struct Totals {
  CourseTotal success;
  CourseTotal collision;
  CourseTotal timeout;
  CourseTotal contact;
  CourseTotal contacts;
  CourseTotal survival_time;
  CourseTotal traversal_time;
  CourseTotal barn_score;
  CourseTotal barn_score_until_2024;
  CourseTotal episode_return;
  CourseTotal path_length;
};

void Add(CourseTotal& total, double value) {
  total.sum += value;
  total.count += 1.0;
}

void AddEpisode(const EpisodeRecord& record, double time, double optimal_time, Totals& totals) {
  const bool success = record.outcome == env::Outcome::kSuccess;
  Add(totals.success, success ? 1.0 : 0.0);
  Add(totals.collision, record.outcome == env::Outcome::kCollision ? 1.0 : 0.0);
  Add(totals.timeout, record.outcome == env::Outcome::kTimeout ? 1.0 : 0.0);
  Add(totals.contact, record.num_collisions > 0 ? 1.0 : 0.0);
  Add(totals.contacts, record.num_collisions);
  Add(success ? totals.traversal_time : totals.survival_time, time);
  Add(totals.barn_score, BarnScore(record.outcome, time, optimal_time));
  Add(totals.barn_score_until_2024,
      BarnScore(record.outcome, time, optimal_time, kBarnLimitUntil2024));
  Add(totals.episode_return, record.episode_return);
  Add(totals.path_length, record.path_length);
}

std::vector<CourseTotal> Column(std::span<const Totals> courses, CourseTotal Totals::*figure) {
  std::vector<CourseTotal> column;
  for (const Totals& totals : courses) column.push_back(totals.*figure);
  return column;
}

int SumOf(const std::vector<CourseTotal>& column) {
  double sum = 0.0;
  for (const CourseTotal& total : column) sum += total.sum;
  return static_cast<int>(std::lround(sum));
}

/// The mean of a score that every episode of a course has. One course alone has no interval for it.
Estimate MeanOfAll(const std::vector<CourseTotal>& column, Interval limits) {
  return EstimateMean(column, limits).value();
}

Figures MakeFigures(std::span<const Totals> courses, double time_limit) {
  const auto success = Column(courses, &Totals::success);
  const auto collision = Column(courses, &Totals::collision);
  const auto timeout = Column(courses, &Totals::timeout);
  const Interval any{-HUGE_VAL, HUGE_VAL};
  Figures figures;
  figures.num_successes = SumOf(success);
  figures.num_collisions = SumOf(collision);
  figures.num_timeouts = SumOf(timeout);
  figures.num_episodes = figures.num_successes + figures.num_collisions + figures.num_timeouts;
  figures.success_rate = EstimateRate(success);
  figures.collision_rate = EstimateRate(collision);
  figures.timeout_rate = EstimateRate(timeout);
  figures.contact_rate = EstimateRate(Column(courses, &Totals::contact));
  figures.num_contacts = SumOf(Column(courses, &Totals::contacts));
  figures.survival_time = EstimateMean(Column(courses, &Totals::survival_time), {0.0, time_limit});
  figures.traversal_time =
      EstimateMean(Column(courses, &Totals::traversal_time), {0.0, time_limit});
  figures.barn_score = MeanOfAll(Column(courses, &Totals::barn_score), {0.0, 1.0 / kBarnLimit});
  figures.barn_score_until_2024 =
      MeanOfAll(Column(courses, &Totals::barn_score_until_2024), {0.0, 1.0 / kBarnLimitUntil2024});
  figures.mean_return = MeanOfAll(Column(courses, &Totals::episode_return), any).value;
  figures.mean_path_length = MeanOfAll(Column(courses, &Totals::path_length), any).value;
  return figures;
}

}  // namespace

double OptimalTime(const sim::Course& course) {
  return sim::ReferenceLength(course) / kReferenceSpeed;
}

double BarnScore(env::Outcome outcome, double time, double optimal_time, double lower_limit) {
  if (outcome != env::Outcome::kSuccess) return 0.0;
  return optimal_time /
         std::clamp(time, lower_limit * optimal_time, kHighestBarnLimit * optimal_time);
}

Summary Summarise(std::span<const EpisodeRecord> records, const sim::CourseSet& courses,
                  double step, double time_limit) {
  std::vector<Totals> totals(courses.courses.size());
  for (const EpisodeRecord& record : records) {
    SLALOM_CHECK(record.outcome != env::Outcome::kRunning);
    AddEpisode(record, record.time(step), OptimalTime(*courses.courses[record.course]),
               totals[record.course]);
  }
  Summary summary;
  summary.set = MakeFigures(totals, time_limit);
  for (int c = 0; c < static_cast<int>(totals.size()); ++c) {
    const sim::Course& course = *courses.courses[c];
    summary.courses.push_back({c, course.name, OptimalTime(course),
                               MakeFigures(std::span(totals).subspan(c, 1), time_limit)});
  }
  return summary;
}

}  // namespace slalom::eval
