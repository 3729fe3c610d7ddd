#include "eval/protocol.h"

#include <gtest/gtest.h>

#include "config/config.h"
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

TEST(Protocol, GivenValuesWin) {
  EvaluationConfig config = Named("dwa-runs");
  EXPECT_EQ(ResolveProtocol(config).time_limit, 100.0);
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

}  // namespace
}  // namespace slalom::eval
