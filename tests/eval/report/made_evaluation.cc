#include "tests/eval/report/made_evaluation.h"

#include <memory>
#include <utility>

#include "base/random.h"
#include "tests/support/fake_environment.h"
#include "tests/support/random_courses.h"
#include "tests/support/reactive_agent.h"

namespace slalom::testing {

eval::Evaluation MakeEvaluation(std::vector<double> success_probability,
                                const eval::EvaluationConfig& config,
                                const std::string& course_prefix) {
  sim::CourseSet courses{"made", {}};
  for (std::size_t c = 0; c < success_probability.size(); ++c) {
    auto course = std::make_shared<sim::Course>();
    course->name = course_prefix + std::to_string(c);
    course->goal_W = {10.0, 0.0};
    course->reference_path_W = {{2.0, 0.0}, {8.0, 0.0}};
    course->bounds = {{-1.0, -5.0}, {11.0, 5.0}};
    for (std::size_t k = 0; k <= c; ++k) {
      course->circles.push_back({{3.0 + static_cast<double>(k), 2.0}, 0.25});
    }
    courses.courses.push_back(std::move(course));
  }
  eval::EvaluationConfig five = config;
  five.episodes_per_course = 5;
  five.num_environments = 4;
  const eval::EvaluationTask task = eval::ResolveEvaluation(five, {}, courses);
  FakeEnvironment environments(task.num_environments, std::move(success_probability));
  SummingAgent agent(task.num_environments);
  return eval::Evaluate(task, environments, agent).value();
}

eval::Evaluation DriveCourses(int num_courses, const sim::EnvironmentConfig& environment) {
  sim::CourseSet courses{"driven", {}};
  base::Random random(11);
  for (int c = 0; c < num_courses; ++c) {
    sim::Course course = *test::RandomCourse(random, {.num_circles = 15, .num_boxes = 3});
    course.name = "driven-" + std::to_string(c);
    course.moving.push_back(
        {0.2, {}, {{0.0, {{3.0, -3.0}, 0.0}}, {6.0, {{3.0, 3.0}, 0.0}}}, sim::Playback::kPingPong});
    course.moving.push_back(
        {0.0, {0.3, 0.1}, {{0.0, {{-3.0, 2.0}, 0.0}}, {4.0, {{4.0, 2.0}, 1.0}}}, {}});
    courses.courses.push_back(std::make_shared<const sim::Course>(std::move(course)));
  }
  eval::EvaluationConfig config;
  config.episodes_per_course = 2;
  config.time_limit = 20.0;
  const auto make_agent = [](const sim::CourseEnvironments&) {
    return std::make_unique<ReactiveAgent>();
  };
  return eval::EvaluateOnCourses(eval::ResolveEvaluation(config, environment, courses), make_agent,
                                 nullptr)
      .value();
}

std::map<std::string, std::string> PaperProtocol() {
  return {{"name", "\"paper\""},
          {"time_limit_s", "80.0"},
          {"goal_tolerance_m", "0.4"},
          {"collision_ends", "true"},
          {"clock_start_distance_m", "0.0"},
          {"start_position_jitter_m", "0.05"},
          {"start_yaw_jitter_rad", "0.05"}};
}

eval::Provenance MakeProvenance(const std::string& agent) {
  eval::Provenance provenance;
  provenance.agent = agent;
  provenance.kind = "planner";
  provenance.source = agent;
  provenance.course_set = "made";
  provenance.commit = "abc123";
  return provenance;
}

}  // namespace slalom::testing
