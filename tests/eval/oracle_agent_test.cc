#include "eval/oracle_agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "eval/evaluation.h"
#include "sim/courses/course_sets.h"
#include "sim/robot.h"

namespace slalom::eval {
namespace {

using testing::HasSubstr;

Evaluation Drive(const std::string& courses, int num_environments, base::ParallelFor* parallel,
                 const sim::MakeRobotBodies& make_bodies = {}) {
  EvaluationConfig config;
  config.episodes_per_course = 1;
  config.num_environments = num_environments;
  sim::EnvironmentConfig task;
  task.episode.step = 0.2;
  EvaluationTask resolved =
      ResolveEvaluation(config, task, sim::ResolveCourses(courses, std::nullopt, 0));
  resolved.physics.make_bodies = make_bodies;
  const auto make_agent = [parallel](const sim::CourseEnvironments& environments) {
    return std::make_unique<OracleAgent>(environments, parallel);
  };
  return EvaluateOnCourses(resolved, make_agent, parallel).value();
}

// What it knows suffices where a robot that stands still, dashes ahead or does not look ahead
// fails.
TEST(OracleAgent, ArrivesAmongObstaclesOfEachKind) {
  base::ParallelFor parallel(2);
  for (const std::string courses :
       {"generated:5:3", "generated-box:5:3", "generated-wall:5:3", "generated-crowds:5:3"}) {
    EXPECT_EQ(Drive(courses, 3, &parallel).summary.set.success_rate.value, 1.0) << courses;
  }
}

TEST(OracleAgent, DoesNotDependOnBatchSizeOrThreads) {
  const Evaluation alone = Drive("generated-box:6:3", 1, nullptr);
  base::ParallelFor parallel(3);
  const Evaluation other = Drive("generated-box:6:3", 3, &parallel);
  EXPECT_EQ(other.episodes.records, alone.episodes.records);
  EXPECT_EQ(other.episodes.tracks, alone.episodes.tracks);
}

/// A robot that never moves, in a physics of its own.
class Statue : public sim::RobotBody {
 public:
  explicit Statue(const sim::EnvironmentConfig& config) : controller_(config.robot, 1) {}
  void Reset(const base::Pose2& X_WR, std::uint64_t) override { pose_ = X_WR; }
  bool Drive(double, double, const sim::Scene&, double) override { return false; }
  base::Pose2 pose() const override { return pose_; }
  const sim::BodyState& body() const override { return body_; }
  const sim::DriveController& drive() const override { return controller_; }

 private:
  base::Pose2 pose_;
  sim::BodyState body_;
  sim::DriveController controller_;
};

TEST(OracleAgent, RefusesARobotThatItCannotCopy) {
  const auto make_statues = [](const sim::EnvironmentConfig& config,
                               std::span<const std::shared_ptr<const sim::Scene>>, int count) {
    std::vector<std::unique_ptr<sim::RobotBody>> statues;
    for (int i = 0; i < count; ++i) statues.push_back(std::make_unique<Statue>(config));
    return statues;
  };
  try {
    Drive("generated:5:1", 1, nullptr, make_statues);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("expected --physics slalom"));
  }
}

}  // namespace
}  // namespace slalom::eval
