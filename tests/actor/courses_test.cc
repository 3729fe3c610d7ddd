#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "actor/actor.h"
#include "sim/courses/course_sets.h"
#include "sim/environments.h"
#include "tests/support/reactive_agent.h"

namespace slalom::actor {
namespace {

/// Shows the number of the course and how many frames of the episode it has seen.
class RememberingTeachers : public Teachers {
 public:
  void Act(const env::ObservationBatch& observations, std::span<const int> courses,
           std::span<float> actions) override {
    seen_.resize(courses.size());
    for (std::size_t i = 0; i < courses.size(); ++i) {
      seen_[i] = observations.first[i] ? 0 : seen_[i] + 1;
      actions[2 * i] = static_cast<float>(courses[i] % 1000) / 1000.0f;
      actions[2 * i + 1] = static_cast<float>(seen_[i]) / 1000.0f;
    }
  }

 private:
  std::vector<int> seen_;
};

/// An actor on real courses, under a drive with a delay, so that an episode has state beyond its
/// pose.
struct CourseActor {
  CourseActor(base::ParallelFor* parallel, const sim::FreshMix& fresh, bool is_taught = false)
      : environments(MakeEnvironment(),
                     sim::MakeScenes(sim::ResolveCourses("generated:3:5", std::nullopt, 0)), 12,
                     parallel, sim::MakeRobots(),
                     fresh.empty() ? nullptr : std::make_unique<sim::SceneStream>(fresh, 8, 30)),
        actor({}, environments, agent, 21,
              {.sampling = fresh.empty() ? Sampling::kUniform : Sampling::kLearnable},
              is_taught ? &teachers : nullptr) {}

  static sim::EnvironmentConfig MakeEnvironment() {
    sim::EnvironmentConfig config;
    config.robot.command_delay = 0.04;
    config.robot.linear_acceleration = 4.0;
    config.lidar.noise_std = 0.02;
    config.episode.start_position_jitter = 0.05;
    return config;
  }

  sim::CourseEnvironments environments;
  testing::ReactiveAgent agent;
  RememberingTeachers teachers;
  Actor actor;
};

void ExpectRestoredGoesOnBitForBit(const sim::FreshMix& fresh, bool is_taught = false) {
  base::ParallelFor parallel(2);
  CourseActor whole(nullptr, fresh, is_taught);
  CourseActor restored(&parallel, fresh, is_taught);
  replay::Chunk chunk(720);
  for (int step = 0; step < 240; ++step) {
    chunk.Clear();
    whole.actor.Step(&chunk);
  }
  ASSERT_GT(whole.actor.stats().num_episodes, 0);
  restored.actor.Restore(ActorState::Parse(whole.actor.Save().Serialize(), "state"));
  EXPECT_EQ(restored.actor.stats().sampling.num_courses, whole.actor.stats().sampling.num_courses);
  replay::Chunk expected(720);
  replay::Chunk found(720);
  for (int step = 0; step < 120; ++step) {
    whole.actor.Step(&expected);
    restored.actor.Step(&found);
  }
  EXPECT_EQ(found.flags, expected.flags);
  EXPECT_EQ(found.action, expected.action);
  EXPECT_EQ(found.state, expected.state);
  EXPECT_EQ(found.reward, expected.reward);
  EXPECT_TRUE(found.ranges_cm == expected.ranges_cm);
  EXPECT_EQ(restored.actor.Save().Serialize(), whole.actor.Save().Serialize());
}

TEST(ActorOnCourses, RestoredGoesOnBitForBit) { ExpectRestoredGoesOnBitForBit({}); }

TEST(ActorOnCourses, RestoredGoesOnBitForBitOnFreshAndLearnableCourses) {
  ExpectRestoredGoesOnBitForBit({sim::FreshKind::kBox});
  ExpectRestoredGoesOnBitForBit({sim::FreshKind::kStatic, sim::FreshKind::kCrowds});
}

TEST(ActorOnCourses, RestoredGoesOnBitForBitWithTeachersThatRemember) {
  ExpectRestoredGoesOnBitForBit({sim::FreshKind::kBox}, /*is_taught=*/true);
}

TEST(ActorOnCourses, TeachersChangeTheActionsOfRowsAndNothingElse) {
  CourseActor alone(nullptr, {}), taught(nullptr, {}, /*is_taught=*/true);
  replay::Chunk rows(720), lessons(720);
  for (int step = 0; step < 60; ++step) {
    alone.actor.Step(&rows);
    taught.actor.Step(&lessons);
  }
  EXPECT_EQ(lessons.flags, rows.flags);
  EXPECT_EQ(lessons.state, rows.state) << "with the actions that were driven";
  EXPECT_EQ(lessons.reward, rows.reward);
  ASSERT_EQ(lessons.num_rows(), rows.num_rows());
  std::vector<int> seen(12, -1);
  for (int r = 0; r < lessons.num_rows(); ++r) {
    const replay::RowView row = lessons.row(r);
    if (row.flags & replay::kRowFinal) continue;
    seen[row.stream] = row.flags & replay::kRowFirst ? 0 : seen[row.stream] + 1;
    EXPECT_EQ(row.action[1], static_cast<float>(seen[row.stream]) / 1000.0f);
    EXPECT_LT(row.action[0], 0.005f) << "one of five courses";
  }
}

}  // namespace
}  // namespace slalom::actor
