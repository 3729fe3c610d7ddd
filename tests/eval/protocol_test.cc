
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "base/config.h"
#include "base/error.h"
#include "eval/evaluation_task.h"

namespace slalom::eval {
namespace {

Protocol Resolved(const std::string& name) {
  EvaluationConfig config;
  config.protocol = name;
  return ResolveProtocol(config);
}

EvaluationConfig Named(const std::string& name) {
  EvaluationConfig config;
  config.protocol = name;
  return config;
}

sim::CourseSet OneCourse() {
  auto course = std::make_shared<sim::Course>();
  course->name = "one";
  course->start = {{-2.0, 3.0}, 1.57};
  course->goal_W = {-2.0, 13.0};
  course->reference_path_W = {{-2.0, 5.0}, {-2.0, 9.0}};
  return {"set", {course}};
}

TEST(Protocol, TheConfigsChoicesAreTheProtocols) {
  EvaluationConfig config;
  const auto fields = config::ListFields(config);
  ASSERT_EQ(fields.fields.front().key, "protocol");
  ASSERT_EQ(fields.fields.front().choices.size(), Protocols().size());
  for (std::size_t i = 0; i < Protocols().size(); ++i) {
    EXPECT_EQ(fields.fields.front().choices[i], Protocols()[i].name);
  }
}

TEST(Protocol, TimeLimitIsTheSameForAnyStep) {
  sim::EnvironmentConfig environment;
  for (const auto& [step, paper, challenge] :
       {std::tuple{0.2, 400, 1000}, {0.05, 1600, 4000}, {0.1, 800, 2000}}) {
    environment.episode.step = step;
    EXPECT_EQ(WithProtocol(environment, Resolved("paper")).episode.max_steps, paper);
    // As long again to set off.
    EXPECT_EQ(WithProtocol(environment, Resolved("barn-challenge")).episode.max_steps, challenge);
  }
}

TEST(Protocol, ReplacesTheTasksOwnRules) {
  sim::EnvironmentConfig environment;
  environment.episode.goal_tolerance = 3.0;
  environment.episode.start_position_jitter = 0.7;
  environment.robot.mass = 7.0;
  EvaluationConfig config = Named("barn-challenge");
  config.start_position_jitter = 0.25;
  config.start_yaw_jitter = 0.5;
  const sim::EnvironmentConfig task =
      ResolveEvaluation(config, environment, OneCourse()).environment;
  EXPECT_EQ(task.episode.goal_tolerance, 1.0);
  EXPECT_EQ(task.episode.start_position_jitter, 0.25);
  EXPECT_EQ(task.episode.start_yaw_jitter, 0.5);
  EXPECT_EQ(task.robot.mass, 7.0);
}

TEST(Protocol, AKeyOfTheTaskThatItReplacesIsRefused) {
  int num_refused = 0;
  for (const Protocol& protocol : Protocols()) {
    EvaluationConfig config = Named(std::string(protocol.name));
    config.start_position_jitter = 0.25;
    config.start_yaw_jitter = 0.5;
    std::istringstream changes(
        config::Changes(ResolveEvaluation(config, {}, OneCourse()).environment));
    for (std::string line; std::getline(changes, line); ++num_refused) {
      const std::string key = "environment." + line.substr(0, line.find(' '));
      EXPECT_THROW(RefuseRuleOfTask(key), base::Error) << key;
    }
  }
  EXPECT_GT(num_refused, 7);
  RefuseRuleOfTask("environment.episode.step");
}

TEST(Protocol, GivenValuesWin) {
  EvaluationConfig config = Named("dwa-runs");
  EXPECT_EQ(ResolveProtocol(config).time_limit, 113.0);
  EXPECT_FALSE(ResolveProtocol(config).collision_ends);
  config.time_limit = 30.0;
  config.goal_tolerance = 0.9;
  EXPECT_EQ(ResolveProtocol(config).time_limit, 30.0);
  EXPECT_EQ(ResolveProtocol(config).goal_tolerance, 0.9);
  EXPECT_FALSE(ResolveProtocol(config).collision_ends);
  EXPECT_FALSE(
      WithProtocol(sim::EnvironmentConfig{}, ResolveProtocol(config)).episode.collision_ends);
  EXPECT_TRUE(WithProtocol(sim::EnvironmentConfig{}, Resolved("paper")).episode.collision_ends);
}

TEST(Protocol, TheChallengeStartsFurtherLeftWithTheGoalTenMetresAhead) {
  const sim::CourseSet shifted = WithProtocol(OneCourse(), Resolved("barn-challenge"));
  EXPECT_EQ(shifted.courses[0]->start, (base::Pose2{{-2.25, 3.0}, 1.57}));
  EXPECT_EQ(shifted.courses[0]->goal_W, (base::Vec2{-2.25, 13.0}));
  EXPECT_EQ(shifted.courses[0]->reference_path_W, OneCourse().courses[0]->reference_path_W);
  EXPECT_EQ(*WithProtocol(OneCourse(), Resolved("paper")).courses[0], *OneCourse().courses[0]);
}

// World 9 of the published set: cells (26, 0) to (15, 29). The harness of the published runs puts a
// cell at (0.15 row - 4.575, 0.15 col + 5.075), the start 1 m before and the goal 5 m beyond.
TEST(Protocol, DwaRunsStartAndEndWhereTheReferencePathDoes) {
  auto course = std::make_shared<sim::Course>(*OneCourse().courses[0]);
  course->start.yaw = 0.5 * base::kPi;
  course->reference_path_W = {{-4.425 + 0.15 * 26, 5.175}, {-4.425 + 0.15 * 15, 5.175 + 0.15 * 29}};
  const sim::CourseSet set{"set", {course}};
  const sim::Course found = *WithProtocol(set, Resolved("dwa-runs")).courses[0];
  EXPECT_NEAR(found.start.p.x, 0.15 * 26 - 4.575, 1e-12);
  EXPECT_NEAR(found.start.p.y, 4.075, 1e-12);
  EXPECT_NEAR(found.goal_W.x, 0.15 * 15 - 4.575, 1e-12);
  EXPECT_NEAR(found.goal_W.y, 14.425, 1e-12);
  EXPECT_EQ(found.start.yaw, course->start.yaw);
  // Success is beyond y = 11 m.
  const sim::EnvironmentConfig task = WithProtocol(sim::EnvironmentConfig{}, Resolved("dwa-runs"));
  EXPECT_NEAR(found.start.p.y + task.episode.finish_ahead, 11.0, 1e-12);
  EXPECT_EQ(task.episode.look_period, 1.13);
  EXPECT_EQ(WithProtocol(sim::EnvironmentConfig{}, Resolved("paper")).episode.finish_ahead, 0.0);
}

TEST(Protocol, DwaRunsNeedAReferencePath) {
  auto course = std::make_shared<sim::Course>(*OneCourse().courses[0]);
  course->reference_path_W.clear();
  try {
    (void)WithProtocol(sim::CourseSet{"set", {course}}, Resolved("dwa-runs"));
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_STREQ(error.what(),
                 "course 'one': has no reference path, expected one because protocol 'dwa-runs' "
                 "starts before its first point and ends beyond its last");
  }
}

}  // namespace
}  // namespace slalom::eval
