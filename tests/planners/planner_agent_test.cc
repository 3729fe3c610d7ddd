#include "planners/planner_agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "base/parallel.h"
#include "sim/courses/course_generator.h"
#include "sim/environments.h"
#include "tests/support/random_courses.h"

namespace slalom::planners {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;

sim::EnvironmentConfig TaskAt20Hz() {
  sim::EnvironmentConfig config;
  config.episode.step = 0.05;
  config.episode.max_steps = 1600;
  config.robot.control_rate = 100.0;
  return config;
}

env::ScanGeometry GeometryOf(const sim::EnvironmentConfig& config) {
  return {.num_beams = config.lidar.num_beams,
          .field_of_view = config.lidar.field_of_view,
          .p_RS = {config.lidar.offset_x, 0.0},
          .clip = config.observation.range_clip};
}

std::vector<std::shared_ptr<const sim::Scene>> RandomScenes(int num) {
  base::Random random(12);
  std::vector<std::shared_ptr<const sim::Scene>> scenes;
  for (int i = 0; i < num; ++i) {
    scenes.push_back(sim::MakeScene(
        test::RandomCourse(random, {.num_circles = 25, .max_radius = 0.2, .clear_start = 0.8})));
  }
  return scenes;
}

/// Defaults, with few enough rollouts for a test.
PlannersConfig Planners() {
  PlannersConfig config;
  config.mppi.batch_size = 200;
  return config;
}

/// Drives `num_steps` steps of episodes (course, seed), one in each slot; the robots' poses.
std::vector<std::vector<base::Pose2>> Drive(const std::string& name,
                                            const std::vector<env::EpisodeSpec>& episodes,
                                            int num_steps, base::ParallelFor* parallel) {
  const sim::EnvironmentConfig config = TaskAt20Hz();
  const int n = static_cast<int>(episodes.size());
  sim::CourseEnvironments environments(config, RandomScenes(4), n, parallel);
  PlannerAgent agent(name, Planners(), GeometryOf(config), config.action, config.episode.step,
                     parallel);
  std::vector<env::Action> actions(episodes.size());
  std::vector<env::StepResult> results(episodes.size());
  std::vector<std::vector<base::Pose2>> poses(episodes.size());
  for (int i = 0; i < n; ++i) environments.Reset(i, episodes[i]);
  for (int step = 0; step < num_steps; ++step) {
    agent.Act(environments.observations(), env::NumbersOf(actions));
    environments.Step(env::NumbersOf(actions), results);
    for (int i = 0; i < n; ++i) poses[i].push_back(environments.robot_pose(i));
  }
  return poses;
}

class EachPlanner : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Planners, EachPlanner, testing::ValuesIn(PlannerNames()),
                         [](const auto& planner) { return planner.param; });

TEST_P(EachPlanner, CrossesAnOpenField) {
  const sim::EnvironmentConfig config = TaskAt20Hz();
  sim::Course course;
  course.name = "open";
  course.start = {{1.0, 2.0}, 1.0};
  course.goal_W = {4.0, 4.0};
  course.circles = {{{2.5, 2.6}, 0.1}, {{3.0, 3.9}, 0.1}};
  sim::CourseEnvironments environments(
      config, {sim::MakeScene(std::make_shared<const sim::Course>(course))}, 1, nullptr);
  PlannerAgent agent(GetParam(), Planners(), GeometryOf(config), config.action, config.episode.step,
                     nullptr);
  environments.Reset(0, {});
  std::vector<env::Action> actions(1);
  std::vector<env::StepResult> results(1);
  for (int step = 0; step < 600 && !results[0].ended(); ++step) {
    agent.Act(environments.observations(), env::NumbersOf(actions));
    environments.Step(env::NumbersOf(actions), results);
  }
  EXPECT_EQ(results[0].outcome, env::Outcome::kSuccess) << agent.Status(0);
  EXPECT_THAT(agent.Status(0), testing::StartsWith(ToString(agent.navigator(0).state())));
}

// An episode is the same alone, in any slot, with any neighbours and on any number of threads.
TEST_P(EachPlanner, DrivesTheSameInAnyBatch) {
  constexpr int kSteps = 30;
  const std::vector<env::EpisodeSpec> episodes = {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {0, 5}};
  const auto together = Drive(GetParam(), episodes, kSteps, nullptr);
  base::ParallelFor threads(3);
  EXPECT_EQ(Drive(GetParam(), episodes, kSteps, &threads), together);
  EXPECT_EQ(Drive(GetParam(), {episodes[3], episodes[1]}, kSteps, nullptr),
            (std::vector<std::vector<base::Pose2>>{together[3], together[1]}));
  EXPECT_NE(together[0].back().p, (base::Vec2{0.0, 0.0})) << "moved";
}

TEST_P(EachPlanner, ForgetsTheEpisodeBefore) {
  const sim::EnvironmentConfig config = TaskAt20Hz();
  sim::CourseEnvironments environments(config, RandomScenes(2), 1, nullptr);
  PlannerAgent agent(GetParam(), Planners(), GeometryOf(config), config.action, config.episode.step,
                     nullptr);
  std::vector<env::Action> actions(1);
  std::vector<env::StepResult> results(1);
  std::vector<std::vector<base::Pose2>> drives;
  for (const int course : {0, 1, 0}) {
    environments.Reset(0, {course, 9});
    drives.emplace_back();
    for (int step = 0; step < 30; ++step) {
      agent.Act(environments.observations(), env::NumbersOf(actions));
      environments.Step(env::NumbersOf(actions), results);
      drives.back().push_back(environments.robot_pose(0));
    }
  }
  EXPECT_EQ(drives[2], drives[0]);
  EXPECT_NE(drives[1], drives[0]);
}

// The robot starts along y of the maps, which are not turned with it.
TEST(PlannerAgent, MapsLieAlongTheStartHeading) {
  const sim::EnvironmentConfig config = TaskAt20Hz();
  sim::Course course;
  course.name = "open";
  course.start = {{1.0, 2.0}, 1.0};
  course.goal_W = base::Transform(course.start, {4.0, -1.0});
  sim::CourseEnvironments environments(
      config, {sim::MakeScene(std::make_shared<const sim::Course>(course))}, 1, nullptr);
  PlannersConfig planners;
  planners.navigation.start_heading = 0.5 * base::kPi;
  PlannerAgent agent("dwa", planners, GeometryOf(config), config.action, config.episode.step,
                     nullptr);
  environments.Reset(0, {});
  std::vector<env::Action> actions(1);
  agent.Act(environments.observations(), env::NumbersOf(actions));
  const auto path = agent.navigator(0).path();
  ASSERT_FALSE(path.empty());
  EXPECT_NEAR(path.back().x, 1.0, 1e-6);
  EXPECT_NEAR(path.back().y, 4.0, 1e-6);
}

TEST(PlannerAgent, DwaDrivesGeneratedCourses) {
  const sim::EnvironmentConfig config = TaskAt20Hz();
  constexpr int kNum = 3;
  const sim::CourseSet set = sim::GenerateFreshCourses(21, kNum);
  sim::CourseEnvironments environments(config, sim::MakeScenes(set), kNum, nullptr);
  PlannerAgent agent("dwa", {}, GeometryOf(config), config.action, config.episode.step, nullptr);
  std::vector<env::Action> actions(kNum);
  std::vector<env::StepResult> results(kNum);
  for (int i = 0; i < kNum; ++i) environments.Reset(i, {i, 1});
  for (int step = 0; step < 800; ++step) {
    agent.Act(environments.observations(), env::NumbersOf(actions));
    environments.Step(env::NumbersOf(actions), results);
  }
  int num_successes = 0;
  for (const auto& result : results) num_successes += result.outcome == env::Outcome::kSuccess;
  EXPECT_GE(num_successes, 2);
}

TEST(PlannerRegistry, KnowsItsPlanners) {
  EXPECT_THAT(PlannerNames(), IsSupersetOf({"dwa", "eband", "teb", "mppi"}));
  const PlannersConfig config;
  for (const std::string& name : PlannerNames()) {
    EXPECT_NE(MakeLocalPlanner(name, config), nullptr);
    EXPECT_GT(NavigationOf(name, config).control_rate, 0.0);
  }
  try {
    PlannerAgent agent("dvva", config, {}, {}, 0.05, nullptr);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_STREQ(error.what(), "there is no planner 'dvva'; there are: dwa, eband, teb, mppi");
  }
}

// Every default is inside its own range, and every field has a meaning.
TEST(PlannersConfig, IsConsistent) {
  PlannersConfig config;
  const std::string text = config::ToToml(config);
  EXPECT_EQ(config::ToToml(config::FromToml<PlannersConfig>(text, "defaults")), text);
  EXPECT_THAT(text, HasSubstr("[dwa.navigation]"));
  EXPECT_THROW(config::FromToml<PlannersConfig>("[dwa]\nmax_speed = -1.0", "bad"), base::Error);
}

}  // namespace
}  // namespace slalom::planners
