#include "eval/summary.h"

#include <gtest/gtest.h>

#include "sim/course.h"

namespace slalom::eval {
namespace {

using env::Outcome;

/// Courses without obstacles or path: the reference is the straight line from start to goal.
sim::CourseSet MakeCourses(std::initializer_list<double> lengths) {
  sim::CourseSet set{"made", {}};
  for (const double length : lengths) {
    auto course = std::make_shared<sim::Course>();
    course->name = "course-" + std::to_string(set.courses.size());
    course->goal_W = {length, 0.0};
    set.courses.push_back(std::move(course));
  }
  return set;
}

EpisodeRecord MakeRecord(int course, int episode, Outcome outcome, int num_steps) {
  EpisodeRecord record;
  record.course = course;
  record.episode = episode;
  record.outcome = outcome;
  record.num_steps = num_steps;
  record.episode_return = 2.0;
  record.path_length = num_steps * 0.25;
  return record;
}

TEST(BarnScore, IsTheTwoTimesFormula) {
  // Optimal time 5 s: 10 s and below give 0.5, 20 s a quarter, 40 s and above an eighth.
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 4.0, 5.0), 0.5);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 10.0, 5.0), 0.5);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 20.0, 5.0), 0.25);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 40.0, 5.0), 0.125);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 79.0, 5.0), 0.125);
  EXPECT_EQ(BarnScore(Outcome::kCollision, 4.0, 5.0), 0.0);
  EXPECT_EQ(BarnScore(Outcome::kTimeout, 80.0, 5.0), 0.0);
}

TEST(Summarise, MatchesAHandComputedCase) {
  const sim::CourseSet courses = MakeCourses({10.0, 20.0});
  const std::vector<EpisodeRecord> records{
      MakeRecord(0, 0, Outcome::kSuccess, 50),    // 10 s, optimal 5 s: 0.5
      MakeRecord(0, 1, Outcome::kCollision, 20),  // 4 s
      MakeRecord(1, 0, Outcome::kSuccess, 200),   // 40 s, optimal 10 s: 0.25
      MakeRecord(1, 1, Outcome::kTimeout, 400),   // 80 s
  };
  const Summary summary = Summarise(records, courses, sim::EpisodeConfig{});
  const Figures& set = summary.set;
  EXPECT_EQ(set.num_episodes, 4);
  EXPECT_EQ(set.num_successes, 2);
  EXPECT_EQ(set.num_collisions, 1);
  EXPECT_EQ(set.num_timeouts, 1);
  EXPECT_DOUBLE_EQ(set.success_rate.value, 0.5);
  EXPECT_DOUBLE_EQ(set.collision_rate.value, 0.25);
  EXPECT_DOUBLE_EQ(set.timeout_rate.value, 0.25);
  EXPECT_DOUBLE_EQ(set.survival_time->value, 42.0);
  EXPECT_DOUBLE_EQ(set.traversal_time->value, 25.0);
  EXPECT_DOUBLE_EQ(set.barn_score.value, 0.1875);
  EXPECT_DOUBLE_EQ(set.mean_return, 2.0);
  EXPECT_DOUBLE_EQ(set.mean_path_length, 41.875);
  ASSERT_EQ(summary.courses.size(), 2u);
  EXPECT_EQ(summary.courses[1].name, "course-1");
  EXPECT_DOUBLE_EQ(summary.courses[1].optimal_time, 10.0);
  EXPECT_DOUBLE_EQ(summary.courses[1].figures.survival_time->value, 80.0);
  EXPECT_DOUBLE_EQ(summary.courses[1].figures.barn_score.value, 0.125);
}

TEST(Summarise, HasNoTimeWhereNoEpisodeGivesOne) {
  const sim::CourseSet courses = MakeCourses({10.0});
  const std::vector<EpisodeRecord> won{MakeRecord(0, 0, Outcome::kSuccess, 30)};
  const std::vector<EpisodeRecord> lost{MakeRecord(0, 0, Outcome::kCollision, 30)};
  EXPECT_FALSE(Summarise(won, courses, {}).set.survival_time.has_value());
  EXPECT_TRUE(Summarise(won, courses, {}).set.traversal_time.has_value());
  EXPECT_TRUE(Summarise(lost, courses, {}).set.survival_time.has_value());
  EXPECT_FALSE(Summarise(lost, courses, {}).set.traversal_time.has_value());
}

}  // namespace
}  // namespace slalom::eval
