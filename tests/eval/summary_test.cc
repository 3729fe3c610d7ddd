#include "eval/summary.h"

#include <gtest/gtest.h>

#include "sim/courses/course.h"

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

TEST(BarnScore, HadAHigherLowerLimitUntil2024) {
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 10.0, 5.0, kBarnLimitUntil2024), 0.25);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 25.0, 5.0, kBarnLimitUntil2024), 0.2);
  EXPECT_DOUBLE_EQ(BarnScore(Outcome::kSuccess, 90.0, 5.0, kBarnLimitUntil2024), 0.125);
}

TEST(Summarise, MatchesAHandComputedCase) {
  const sim::CourseSet courses = MakeCourses({10.0, 20.0});
  const std::vector<EpisodeRecord> records{
      MakeRecord(0, 0, Outcome::kSuccess, 50),    // 10 s, optimal 5 s: 0.5
      MakeRecord(0, 1, Outcome::kCollision, 20),  // 4 s
      MakeRecord(1, 0, Outcome::kSuccess, 200),   // 40 s, optimal 10 s: 0.25
      MakeRecord(1, 1, Outcome::kTimeout, 400),   // 80 s
  };
  const Summary summary = Summarise(records, courses, 0.2, 80.0);
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

TEST(Summarise, CountsContactsAndTimeOnTheProtocolsClock) {
  const sim::CourseSet courses = MakeCourses({10.0});
  std::vector<EpisodeRecord> records{
      MakeRecord(0, 0, Outcome::kSuccess, 100), MakeRecord(0, 1, Outcome::kSuccess, 100),
      MakeRecord(0, 2, Outcome::kTimeout, 500), MakeRecord(0, 3, Outcome::kSuccess, 100)};
  records[0].num_collisions = 3;
  records[2].num_collisions = 1;
  records[3].clock_start_step = 40;
  const Figures set = Summarise(records, courses, 0.2, 100.0).set;
  EXPECT_DOUBLE_EQ(set.contact_rate.value, 0.5);
  EXPECT_EQ(set.num_contacts, 4);
  EXPECT_EQ(set.num_collisions, 0);
  EXPECT_NEAR(set.traversal_time->value, (20.0 + 20.0 + 12.0) / 3.0, 1e-12);
  // Optimal time 5 s: 5 / 20 twice and 5 / 12; with the older limit 5 / 20 for all three.
  EXPECT_NEAR(set.barn_score.value, (0.25 + 0.25 + 5.0 / 12.0) / 4.0, 1e-12);
  EXPECT_NEAR(set.barn_score_until_2024.value, 0.75 / 4.0, 1e-12);
}

TEST(Summarise, HasNoTimeWhereNoEpisodeGivesOne) {
  const sim::CourseSet courses = MakeCourses({10.0});
  const std::vector<EpisodeRecord> won{MakeRecord(0, 0, Outcome::kSuccess, 30)};
  const std::vector<EpisodeRecord> lost{MakeRecord(0, 0, Outcome::kCollision, 30)};
  EXPECT_FALSE(Summarise(won, courses, 0.2, 80.0).set.survival_time.has_value());
  EXPECT_TRUE(Summarise(won, courses, 0.2, 80.0).set.traversal_time.has_value());
  EXPECT_TRUE(Summarise(lost, courses, 0.2, 80.0).set.survival_time.has_value());
  EXPECT_FALSE(Summarise(lost, courses, 0.2, 80.0).set.traversal_time.has_value());
}

}  // namespace
}  // namespace slalom::eval
