#include "eval/episodes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "base/error.h"
#include "tests/support/fake_environment.h"

namespace slalom::eval {
namespace {

sim::CourseSet MakeCourses(int n, const std::string& prefix = "course-") {
  sim::CourseSet set{"made", {}};
  for (int c = 0; c < n; ++c) {
    auto course = std::make_shared<sim::Course>();
    course->name = prefix + std::to_string(c);
    course->goal_W = {10.0, 0.0};
    set.courses.push_back(std::move(course));
  }
  return set;
}

EvaluationConfig MakeConfig() {
  EvaluationConfig config;
  config.episodes_per_course = 6;
  config.recorded_episodes_per_course = 2;
  config.seed = 42;
  return config;
}

Episodes RunFake(int batch_size, const EvaluationConfig& config) {
  testing::FakeEnvironment environments(batch_size, {0.1, 0.5, 0.9});
  testing::SummingAgent agent(batch_size);
  return RunEpisodes(config, MakeCourses(3), environments, agent).value();
}

TEST(RunEpisodes, DoesNotDependOnTheBatchSize) {
  const Episodes one = RunFake(1, MakeConfig());
  ASSERT_EQ(one.records.size(), 18u);
  for (const int batch_size : {2, 5, 18, 40}) {
    const Episodes other = RunFake(batch_size, MakeConfig());
    EXPECT_EQ(other.records, one.records) << batch_size;
    EXPECT_EQ(other.tracks, one.tracks);
  }
}

TEST(RunEpisodes, RecordsWhatAPlainLoopSees) {
  const EvaluationConfig config = MakeConfig();
  const Episodes episodes = RunFake(5, config);
  const sim::CourseSet courses = MakeCourses(3);
  testing::FakeEnvironment environment(1, {0.1, 0.5, 0.9});
  for (int k = 0; k < 18; ++k) {
    EpisodeRecord expected{k / 6, k % 6, 0};
    expected.seed = EvaluationSeed(42, *courses.courses[expected.course], expected.episode);
    testing::SummingAgent agent(1);
    std::vector<env::Action> action(1);
    std::vector<env::StepResult> result(1);
    std::vector<base::Pose2> X_WR;
    const auto look = [&] {
      X_WR.push_back(environment.robot_pose(0));
      for (const std::uint16_t range : environment.observations().ranges_cm) {
        expected.min_range = std::min(expected.min_range, 0.01 * range);
      }
    };
    environment.Reset(0, {expected.course, expected.seed});
    expected.min_range = 100.0;
    look();
    while (!result[0].ended()) {
      agent.Act(environment.observations(), action);
      environment.Step(action, result);
      look();
      ++expected.num_steps;
      expected.episode_return += static_cast<double>(result[0].reward);
      expected.path_length += base::Norm(X_WR.back().p - X_WR[X_WR.size() - 2].p);
    }
    expected.outcome = result[0].outcome;
    EXPECT_EQ(episodes.records[k], expected) << k;
    if (expected.episode < 2) {
      const sim::EpisodeTrack track{courses.courses[expected.course]->name, expected.outcome, X_WR};
      EXPECT_EQ(episodes.tracks[expected.course * 2 + expected.episode], track);
    }
  }
}

TEST(RunEpisodes, ReportsProgressUpToTheEnd) {
  testing::FakeEnvironment environments(4, {0.5, 0.5});
  testing::SummingAgent agent(4);
  int last = 0;
  const auto progress = [&](int num_ended, int num_episodes) {
    EXPECT_GE(num_ended, last);
    EXPECT_EQ(num_episodes, 12);
    last = num_ended;
  };
  ASSERT_TRUE(RunEpisodes(MakeConfig(), MakeCourses(2), environments, agent, progress).has_value());
  EXPECT_EQ(last, 12);
}

TEST(RunEpisodes, GivesNothingWhenStopped) {
  testing::FakeEnvironment environments(4, {0.5, 0.5});
  testing::SummingAgent agent(4);
  std::stop_source source;
  const auto progress = [&](int num_ended, int) {
    if (num_ended >= 3) source.request_stop();
  };
  EXPECT_FALSE(
      RunEpisodes(MakeConfig(), MakeCourses(2), environments, agent, progress, source.get_token())
          .has_value());
  EXPECT_LT(environments.specs().size(), 12u);
}

TEST(RunEpisodes, RefusesActionsThatAreNotFinite) {
  testing::FakeEnvironment environments(2, {0.5});
  testing::ConstantAgent agent({0.0f, std::nanf("")});
  EXPECT_THROW((void)RunEpisodes(MakeConfig(), MakeCourses(1), environments, agent), base::Error);
}

TEST(EvaluationSeed, IsTheSameForACourseInAnySet) {
  const sim::CourseSet all = MakeCourses(5);
  sim::Course copy = *all.courses[3];
  EXPECT_EQ(EvaluationSeed(1, copy, 7), EvaluationSeed(1, *all.courses[3], 7));
}

TEST(EvaluationSeed, DiffersByCourseEpisodeAndRoot) {
  std::set<std::uint64_t> seeds;
  const sim::CourseSet courses = MakeCourses(20);
  for (const std::int64_t root : {1, 2, 3}) {
    for (const auto& course : courses.courses) {
      for (int episode = 0; episode < 10; ++episode) {
        seeds.insert(EvaluationSeed(root, *course, episode));
      }
    }
  }
  EXPECT_EQ(seeds.size(), 600u);
}

}  // namespace
}  // namespace slalom::eval
