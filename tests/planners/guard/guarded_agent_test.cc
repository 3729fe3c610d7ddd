#include "planners/guard/guarded_agent.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "base/random.h"
#include "sim/courses/crowd_generator.h"
#include "sim/environments.h"
#include "tests/support/random_courses.h"

namespace slalom::planners {
namespace {

/// Drives straight ahead at full speed, whatever it sees.
class BlindAgent : public env::Agent {
 public:
  void Act(const env::ObservationBatch&, std::span<float> actions) override {
    for (env::Action& action : env::AsActions(actions)) action = {1.0f, 0.1f};
  }
  std::string Status(int) const override { return "blind"; }
};

std::vector<std::shared_ptr<const sim::Scene>> RandomScenes(int num) {
  base::Random random(5);
  std::vector<std::shared_ptr<const sim::Scene>> scenes;
  for (int i = 0; i < num; ++i) {
    scenes.push_back(sim::MakeScene(test::RandomCourse(random, {.clear_start = 0.4})));
  }
  return scenes;
}

/// Those of crowds, in which most actions are changed for what moves.
std::vector<std::shared_ptr<const sim::Scene>> Crowds(int num) {
  std::vector<std::shared_ptr<const sim::Scene>> scenes;
  for (const auto& course : sim::GenerateFreshCrowdCourses(3, num).courses) {
    scenes.push_back(sim::MakeScene(course));
  }
  return scenes;
}

/// Commands act late, so that what is on its way counts.
sim::EnvironmentConfig LateTask() {
  sim::EnvironmentConfig config;
  config.robot.command_delay = 0.3;
  return config;
}

struct Drive {
  std::vector<base::Pose2> poses;
  std::vector<bool> interventions;
  std::string status;  ///< At the end.

  bool operator==(const Drive&) const = default;
};

/// Drives `num_steps` steps of episodes (course, seed) one after the other in each slot.
class Driver {
 public:
  explicit Driver(int batch_size, bool tracking = false)
      : environments_(LateTask(), tracking ? Crowds(3) : RandomScenes(3), batch_size, nullptr),
        agent_(std::make_unique<BlindAgent>(), {.shield = true, .tracking = tracking},
               {.model = {.delay = 0.3}}),
        tracking_(tracking),
        actions_(static_cast<std::size_t>(batch_size)) {}

  std::vector<Drive> Run(const std::vector<env::EpisodeSpec>& episodes, int num_steps) {
    const int n = static_cast<int>(episodes.size());
    for (int i = 0; i < n; ++i) environments_.Reset(i, episodes[i]);
    std::vector<Drive> drives(episodes.size());
    std::vector<env::StepResult> results(episodes.size());
    for (int step = 0; step < num_steps; ++step) {
      agent_.Act(environments_.observations(), env::NumbersOf(actions_));
      for (int i = 0; i < n; ++i) drives[i].interventions.push_back(agent_.Intervened(i));
      environments_.Step(env::NumbersOf(actions_), results);
      for (int i = 0; i < n; ++i) {
        EXPECT_TRUE(tracking_ || results[i].outcome != env::Outcome::kCollision);
        drives[i].poses.push_back(environments_.robot_pose(i));
        drives[i].status = agent_.Status(i);
      }
    }
    return drives;
  }

 private:
  sim::CourseEnvironments environments_;
  GuardedAgent agent_;
  const bool tracking_;  // Then something moves, and may touch the robot.
  std::vector<env::Action> actions_;
};

TEST(GuardedAgentTest, AnEpisodeIsTheSameInAnyBatchAndAfterAnother) {
  const std::vector<env::EpisodeSpec> episodes = {{0, 1}, {1, 2}, {2, 3}};
  for (const bool tracking : {false, true}) {
    Driver batch(3, tracking);
    const std::vector<Drive> first = batch.Run(episodes, 30);
    batch.Run({episodes[2], episodes[0], episodes[1]}, 3);  // Cut off under way.
    const std::vector<Drive> second = batch.Run({episodes[2], episodes[0], episodes[1]}, 30);
    EXPECT_EQ(second[0], first[2]) << tracking;
    EXPECT_EQ(second[1], first[0]) << tracking;
    EXPECT_EQ(second[2], first[1]) << tracking;
    for (std::size_t i = 0; i < episodes.size(); ++i) {
      Driver alone(1, tracking);
      EXPECT_EQ(alone.Run({episodes[i]}, 30)[0], first[i]) << tracking << " " << i;
    }
  }
}

TEST(GuardedAgentTest, SaysWhatItChanged) {
  Driver driver(1);
  for (int episode = 0; episode < 2; ++episode) {
    const Drive drive = driver.Run({{episode, 1}}, 25)[0];
    const auto changed = std::ranges::count(drive.interventions, true);
    EXPECT_GT(changed, 3) << "the robot was never in the way of anything";
    EXPECT_LT(changed, 25);
    EXPECT_EQ(drive.status, fmt::format("blind; guard changed {} of 25 actions", changed));
  }
}

TEST(GuardedAgentTest, LeavesActionsThatPassAsTheyAre) {
  GuardedAgent agent(std::make_unique<BlindAgent>(), {.shield = true}, {});
  env::ObservationBatch observations;
  observations.Resize(1, 720);
  std::ranges::fill(observations.ranges_cm, std::uint16_t{500});
  std::vector<env::Action> actions(1);
  agent.Act(observations, env::NumbersOf(actions));
  EXPECT_EQ(actions[0], (env::Action{1.0f, 0.1f}));
  EXPECT_FALSE(agent.Intervened(0));
}

}  // namespace
}  // namespace slalom::planners
