#include "planners/localisation/scan_matching_agent.h"

#include <gtest/gtest.h>

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "env/action.h"
#include "sim/courses/real_world_courses.h"
#include "sim/environments.h"
#include "sim/scene.h"

namespace slalom::planners {
namespace {

/// Drives a curve, and keeps what it was shown.
class Recorder : public env::Agent {
 public:
  explicit Recorder(env::ObservationBatch& shown) : shown_(shown) {}

  void Act(const env::ObservationBatch& observations, std::span<float> actions) override {
    shown_ = observations;
    for (env::Action& action : env::AsActions(actions)) action = {-0.2f, 0.1f};
  }
  std::string Status(int) const override { return "records"; }
  bool Intervened(int i) const override { return i == 0; }

 private:
  env::ObservationBatch& shown_;
};

sim::EnvironmentConfig DriftingTask() {
  sim::EnvironmentConfig config;
  config.localisation = {.position_drift = 0.1, .heading_drift = 0.02, .turn_drift = 0.05};
  return config;
}

class ScanMatchingAgentTest : public ::testing::Test {
 protected:
  /// What the agent is shown at last in each episode of a batch.
  env::ObservationBatch Drive(const std::vector<env::EpisodeSpec>& episodes, int num_steps) {
    const int n = static_cast<int>(episodes.size());
    if (!environments_ || environments_->batch_size() != n) {
      environments_.emplace(DriftingTask(), scenes_, n, nullptr);
    }
    for (int i = 0; i < n; ++i) environments_->Reset(i, episodes[i]);
    std::vector<env::Action> actions(episodes.size());
    std::vector<env::StepResult> results(episodes.size());
    for (int step = 0; step < num_steps; ++step) {
      agent_.Act(environments_->observations(), env::NumbersOf(actions));
      if (step + 1 < num_steps) environments_->Step(env::NumbersOf(actions), results);
    }
    return shown_;
  }

  std::vector<std::shared_ptr<const sim::Scene>> scenes_ = {
      sim::MakeScene(std::make_shared<sim::Course>(sim::RealWorldCourse(2))),
      sim::MakeScene(std::make_shared<sim::Course>(sim::RealWorldCourse(3)))};
  std::optional<sim::CourseEnvironments> environments_;
  env::ObservationBatch shown_;
  ScanMatchingAgent agent_{std::make_unique<Recorder>(shown_), {}};
};

TEST_F(ScanMatchingAgentTest, ShowsPoseAndGoalCorrected) {
  const std::vector<env::EpisodeSpec> episodes = {{1, 1}, {1, 2}, {1, 3}, {1, 4}};
  Drive(episodes, 25);
  double told = 0.0, corrected = 0.0;
  for (int i = 0; i < 4; ++i) {
    const base::Pose2 truth = environments_->robot_pose(i);  // The course starts at the origin.
    const base::Vec2 goal_R = base::InverseTransform(truth, sim::RealWorldCourse(3).goal_W);
    const auto error = [&](const env::ObservationBatch& observations) {
      const std::span<const float> state = observations.frame(i).state;
      return base::Norm(observations.odometry[i].X_OR.p - truth.p) +
             base::Norm(base::Vec2{state[0], state[1]} - goal_R);
    };
    told += error(environments_->observations());
    corrected += error(shown_);
    EXPECT_LT(base::Norm(shown_.odometry[i].X_OR.p - truth.p), 0.05) << i;
    // The goal stays where it is in the frame of odometry.
    const auto goal_O = [&](const env::ObservationBatch& observations) {
      const std::span<const float> state = observations.frame(i).state;
      return base::Transform(observations.odometry[i].X_OR, {state[0], state[1]});
    };
    EXPECT_LT(base::Norm(goal_O(shown_) - goal_O(environments_->observations())), 1e-4) << i;
  }
  EXPECT_LT(corrected, 0.3 * told);
}

TEST_F(ScanMatchingAgentTest, AnEpisodeIsTheSameInAnyBatchAndAfterAnother) {
  const std::vector<env::EpisodeSpec> episodes = {{0, 1}, {1, 2}, {1, 3}};
  const std::vector<env::Odometry> first = Drive(episodes, 12).odometry;
  const std::vector<env::Odometry> second =
      Drive({episodes[2], episodes[0], episodes[1]}, 12).odometry;
  EXPECT_EQ(second, (std::vector{first[2], first[0], first[1]}));
  EXPECT_EQ(Drive({episodes[1]}, 12).odometry[0], first[1]);
}

TEST_F(ScanMatchingAgentTest, LeavesTheRestToTheAgent) {
  Drive({{0, 1}, {0, 2}}, 3);
  EXPECT_EQ(agent_.Status(1), "records");
  EXPECT_TRUE(agent_.Intervened(0));
  EXPECT_FALSE(agent_.Intervened(1));
  EXPECT_EQ(shown_.ranges_cm, environments_->observations().ranges_cm);
}

}  // namespace
}  // namespace slalom::planners
