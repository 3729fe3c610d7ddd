#include "planners/guard/guide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "planners/guard/guarded_agent.h"
#include "planners/planner_registry.h"
#include "sim/environments.h"

namespace slalom::planners {
namespace {

using testing::Optional;

/// Drives towards the goal that it sees, and knows no obstacles.
class GreedyAgent : public env::Agent {
 public:
  void Act(const env::ObservationBatch& observations, std::span<float> numbers) override {
    const auto actions = env::AsActions(numbers);
    for (int i = 0; i < observations.batch_size; ++i) {
      const std::span<const float> state = observations.frame(i).state;
      const double side = std::atan2(state[1], state[0]);
      actions[i] = env::ActionBounds{}.Normalise(std::abs(side) < 0.8 ? 1.0 : 0.2, 2.0 * side);
    }
  }
};

/// MPPI with few samples, which does not give up.
GuidePlanner Planner() {
  PlannersConfig config;
  config.mppi.batch_size = 300;
  config.navigation.obstacle_range = 4.5;
  config.navigation.raytrace_range = 5.0;
  config.navigation.marks_stay = true;
  config.navigation.planner_patience = config.navigation.controller_patience = 1e6;
  return {config.navigation, NavigationOf("mppi", config),
          [config] { return MakeLocalPlanner("mppi", config); }};
}

/// A pocket that is open towards the start, between it and the goal.
std::shared_ptr<const sim::Scene> Pocket() {
  sim::Course course;
  course.name = "pocket";
  course.goal_W = {6.0, 0.0};
  course.bounds = {{-4.0, -5.0}, {8.0, 5.0}};
  course.boxes = {{{{3.0, 0.0}, 0.0}, {0.1, 1.5}},
                  {{{2.0, 1.5}, 0.0}, {1.1, 0.1}},
                  {{{2.0, -1.5}, 0.0}, {1.1, 0.1}}};
  return sim::MakeScene(std::make_shared<const sim::Course>(std::move(course)));
}

/// How two episodes of the greedy agent end, one after the other, under a guard.
std::vector<env::Outcome> DriveTwice(const GuardConfig& config) {
  sim::EnvironmentConfig task;
  task.episode.max_steps = 300;
  sim::CourseEnvironments environments(task, {Pocket()}, 1, nullptr);
  GuardedRobot robot;
  robot.guide = Planner();
  GuardedAgent agent(std::make_unique<GreedyAgent>(), config, robot);
  std::vector<env::Outcome> outcomes;
  for (const std::uint64_t seed : {1, 2}) {
    std::vector<env::Action> actions(1);
    std::vector<env::StepResult> results(1);
    environments.Reset(0, {0, seed});
    while (!results[0].ended()) {
      agent.Act(environments.observations(), env::NumbersOf(actions));
      environments.Step(env::NumbersOf(actions), results);
    }
    outcomes.push_back(results[0].outcome);
  }
  return outcomes;
}

TEST(GuideTest, LeadsOutOfAPocketThatTheAgentDoesNotLeave) {
  using enum env::Outcome;
  using testing::ElementsAre;
  EXPECT_THAT(DriveTwice({}), ElementsAre(kCollision, kCollision));
  EXPECT_THAT(DriveTwice({.shield = true}), ElementsAre(kTimeout, kTimeout));
  for (const double after : {0.0, 4.0}) {
    EXPECT_THAT(DriveTwice({.shield = true, .waypoints = true, .waypoint_after = after}),
                ElementsAre(kSuccess, kSuccess))
        << after;
  }
}

/// A guide in an open field, whose robot is moved by hand. Steps of 0.2 s.
class InTheOpen {
 public:
  explicit InTheOpen(const GuardConfig& config) : guide_(config, Planner(), {}, 0.2) { Reset(); }
  void Reset() { guide_.Reset({}, {10.0, 0.0}, 1); }
  Guide::Advice See(const base::Pose2& X_OR) { return guide_.See(ranges_, {X_OR, 0.0, 0.0}); }

 private:
  Guide guide_;
  const std::vector<std::uint16_t> ranges_ = std::vector<std::uint16_t>(720, 500);
};

TEST(GuideTest, IsSilentAsLongAsTheRobotGetsOn) {
  InTheOpen open({.waypoints = true, .waypoint_after = 2.0});
  for (int episode = 0; episode < 2; ++episode) {
    open.Reset();
    for (int i = 0; i < 20; ++i) {
      const Guide::Advice advice = open.See({{0.05 * i, 0.0}, 0.0});
      EXPECT_FALSE(advice.waypoint_R || advice.command) << i << ": 0.3 m in 1.2 s";
    }
    int num_silent = 0;
    for (int i = 0; i < 30; ++i) {
      const Guide::Advice advice = open.See({{1.0, 0.0}, 0.0});
      num_silent += !advice.waypoint_R && !advice.command;
    }
    EXPECT_GE(num_silent, 6) << "the time since the last progress";
    EXPECT_LE(num_silent, 12);
  }
}

TEST(GuideTest, ShowsAPointOfThePathAndTurnsTowardsIt) {
  InTheOpen open({.waypoints = true, .waypoint_after = 0.0});
  (void)open.See({});  // Plans at its end.
  const Guide::Advice ahead = open.See({});
  ASSERT_TRUE(ahead.waypoint_R);
  EXPECT_NEAR(ahead.waypoint_R->x, 3.0, 0.2);
  EXPECT_NEAR(ahead.waypoint_R->y, 0.0, 0.2);
  EXPECT_FALSE(ahead.command);
  EXPECT_THAT(open.See({{0.0, 0.0}, 2.0}).command, Optional(Twist{0.0, -1.5}));
  EXPECT_THAT(open.See({{0.0, 0.0}, 0.8}).command, Optional(Twist{0.0, -1.5})) << "not done yet";
  EXPECT_FALSE(open.See({{0.0, 0.0}, 0.4}).command);
  EXPECT_FALSE(open.See({{0.0, 0.0}, 0.8}).command) << "not far enough to begin again";
  EXPECT_THAT(open.See({{0.0, 0.0}, -2.0}).command, Optional(Twist{0.0, 1.5}));
}

TEST(GuideTest, LeavesARobotAloneNearAGoalThatItHasBeenAt) {
  InTheOpen open({.waypoints = true, .waypoint_after = 0.0});
  for (int episode = 0; episode < 2; ++episode) {
    open.Reset();
    (void)open.See({});
    EXPECT_TRUE(open.See({{9.1, 0.0}, 0.0}).waypoint_R) << "it has not been there yet";
    for (int i = 0; i < 30 && !open.See({{9.1, 0.0}, 0.0}).command; ++i) continue;
    EXPECT_TRUE(open.See({{9.1, 0.0}, 0.0}).command) << "a planner drives";
    for (const double x : {9.8, 9.1}) {
      const Guide::Advice advice = open.See({{x, 0.0}, 2.0});
      EXPECT_FALSE(advice.waypoint_R || advice.command) << x;
    }
    EXPECT_TRUE(open.See({{8.9, 0.0}, 0.0}).waypoint_R);
  }
}

// Whatever the episode before ended in: turns, a rescue, or a way that was nearly driven.
TEST(GuideTest, BeginsAnEpisodeAsAFreshGuide) {
  const GuardConfig config{
      .waypoints = true, .waypoint_after = 0.0, .rescue_after = 2.0, .rescue_time = 1.0};
  const std::vector<base::Pose2> turned(3, {{1.0, 0.0}, 2.0}), stood(12, {{1.0, 0.0}, 0.0}),
      arrived(8, {{8.5, 0.0}, 0.0});
  for (const std::vector<base::Pose2>& before : {turned, stood, arrived}) {
    InTheOpen used(config), fresh(config);
    for (const base::Pose2& X_OR : before) (void)used.See(X_OR);
    used.Reset();
    for (int i = 0; i < 40; ++i) {
      const base::Pose2 X_OR{{0.04 * i, 0.0}, i < 3 ? 0.8 : 0.0};
      const Guide::Advice a = used.See(X_OR), b = fresh.See(X_OR);
      ASSERT_EQ(a.command, b.command) << before.size() << ", step " << i;
      ASSERT_EQ(a.waypoint_R, b.waypoint_R) << before.size() << ", step " << i;
    }
  }
}

TEST(GuideTest, ARobotThatStandsIsBackedUpAndAPlannerDrivesEachTimeForLonger) {
  InTheOpen open(
      {.waypoints = true, .waypoint_after = 0.0, .rescue_after = 2.0, .rescue_time = 1.0});
  for (int episode = 0; episode < 2; ++episode) {
    open.Reset();
    std::string who;  // Of the steps: the agent, or a planner that begins from a stand.
    for (int i = 0; i < 60; ++i) {
      const Guide::Advice advice = open.See({{1.0, 0.0}, 0.0});
      who += !advice.command ? 'a' : advice.command->linear >= 0.0 ? 'p' : 'b';
    }
    EXPECT_THAT(who, testing::MatchesRegex("aaaaaaaaaaa?a?a?b{8}p{5}a+b{8}p{10}(a.*)?"));
  }
}

}  // namespace
}  // namespace slalom::planners
