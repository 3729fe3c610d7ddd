#include <gtest/gtest.h>

#include "actor/actor.h"
#include "sim/courses/course_sets.h"
#include "sim/environments.h"
#include "tests/support/reactive_agent.h"

namespace slalom::actor {
namespace {

/// An actor on real courses, under a drive with a delay, so that an episode has state beyond its
/// pose.
struct CourseActor {
  CourseActor(base::ParallelFor* parallel, const sim::FreshMix& fresh)
      : environments(MakeEnvironment(),
                     sim::MakeScenes(sim::ResolveCourses("generated:3:5", std::nullopt, 0)), 12,
                     parallel, sim::MakeRobots(),
                     fresh.empty() ? nullptr : std::make_unique<sim::SceneStream>(fresh, 8, 30)),
        actor({}, environments, agent, 21,
              {.sampling = fresh.empty() ? Sampling::kUniform : Sampling::kLearnable}) {}

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
  Actor actor;
};

void ExpectRestoredGoesOnBitForBit(const sim::FreshMix& fresh) {
  base::ParallelFor parallel(2);
  CourseActor whole(nullptr, fresh);
  CourseActor restored(&parallel, fresh);
  replay::Chunk chunk(720);
  for (int step = 0; step < 240; ++step) {
    chunk.Clear();
    whole.actor.Step(&chunk);
  }
  ASSERT_GT(whole.actor.stats().num_episodes, 0);
  restored.actor.Restore(ActorState::Parse(whole.actor.Save().Serialize(), "state"));
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

}  // namespace
}  // namespace slalom::actor
