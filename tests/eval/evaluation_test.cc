#include "eval/evaluation.h"

#include <gtest/gtest.h>

#include "sim/courses/course_sets.h"
#include "tests/support/reactive_agent.h"

namespace slalom::eval {
namespace {

std::unique_ptr<env::Agent> MakeReactive(const sim::CourseEnvironments&) {
  return std::make_unique<testing::ReactiveAgent>();
}

EvaluationConfig MakeProtocol(int num_environments) {
  EvaluationConfig protocol;
  protocol.episodes_per_course = 3;
  protocol.recorded_episodes_per_course = 3;
  protocol.num_environments = num_environments;
  return protocol;
}

Evaluation RunOnCourses(int num_environments, base::ParallelFor* parallel) {
  const sim::CourseSet courses = sim::ResolveCourses("generated:7:6", std::nullopt, 0);
  return EvaluateOnCourses(ResolveEvaluation(MakeProtocol(num_environments), {}, courses),
                           MakeReactive, parallel)
      .value();
}

TEST(EvaluateOnCourses, DoesNotDependOnBatchSizeOrThreads) {
  const Evaluation alone = RunOnCourses(1, nullptr);
  ASSERT_EQ(alone.episodes.records.size(), 18u);
  // The agent must have met more than one outcome, or this would show little.
  EXPECT_GT(alone.summary.set.num_successes, 0);
  EXPECT_GT(alone.summary.set.num_collisions + alone.summary.set.num_timeouts, 0);
  base::ParallelFor parallel(3);
  for (const int num_environments : {5, 64}) {
    const Evaluation other = RunOnCourses(num_environments, &parallel);
    EXPECT_EQ(other.episodes.records, alone.episodes.records) << num_environments;
    EXPECT_EQ(other.episodes.tracks, alone.episodes.tracks);
  }
}

TEST(EvaluateOnCourses, StartsWithinTheProtocolsJitter) {
  const Evaluation evaluation = RunOnCourses(64, nullptr);
  const sim::CourseSet courses = sim::ResolveCourses("generated:7:6", std::nullopt, 0);
  bool any_apart = false;
  ASSERT_EQ(evaluation.episodes.tracks.size(), 18u);
  for (std::size_t t = 0; t < 18; ++t) {
    const base::Pose2& start = courses.courses[t / 3]->start;
    const base::Pose2& X_WR = evaluation.episodes.tracks[t].poses.front();
    EXPECT_LE(std::abs(X_WR.p.x - start.p.x), 0.05);
    EXPECT_LE(std::abs(X_WR.p.y - start.p.y), 0.05);
    EXPECT_LE(std::abs(base::WrapAngle(X_WR.yaw - start.yaw)), 0.05 + 1e-12);
    any_apart |= X_WR.p != start.p;
  }
  EXPECT_TRUE(any_apart);
}

TEST(EvaluateOnCourses, DrivesACourseAlikeInAnySet) {
  const sim::CourseSet courses = sim::ResolveCourses("generated:7:6", std::nullopt, 0);
  const sim::CourseSet last{"last", {courses.courses.back()}};
  const Evaluation all = RunOnCourses(64, nullptr);
  const Evaluation one =
      EvaluateOnCourses(ResolveEvaluation(MakeProtocol(64), {}, last), MakeReactive, nullptr)
          .value();
  for (int k = 0; k < 3; ++k) {
    EpisodeRecord expected = all.episodes.records[15 + k];
    expected.course = 0;
    EXPECT_EQ(one.episodes.records[k], expected);
  }
}

TEST(ResolveEvaluation, MakesNoMoreEnvironmentsThanThereAreEpisodes) {
  const sim::CourseSet courses{"three", std::vector(3, std::make_shared<const sim::Course>())};
  EXPECT_EQ(ResolveEvaluation(MakeProtocol(64), {}, courses).num_environments, 9);
  EXPECT_EQ(ResolveEvaluation(MakeProtocol(4), {}, courses).num_environments, 4);
}

}  // namespace
}  // namespace slalom::eval
