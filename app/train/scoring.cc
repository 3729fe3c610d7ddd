#include "app/train/scoring.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "app/train/inputs.h"
#include "app/train/training_overlap.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"

namespace slalom::train {
namespace {

/// Shows how many episodes have ended, at what rate, the time left and the success so far. This
/// says less than the final score, because the episodes that end early are the short ones.
class EpisodeProgress {
 public:
  explicit EpisodeProgress(std::string what) : what_(std::move(what)) {}

  void Show(const eval::EpisodeCount& count) {
    const double now =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const double left = count.ended > 0 ? now * (count.all - count.ended) / count.ended : -1.0;
    const double percent = 100.0 / std::max(count.ended, 1);
    line_.Show(fmt::format("{}: {} of {} episodes ({:.1f}/s)  left {}  success {:.0f} %  collision "
                           "{:.0f} %",
                           what_, count.ended, count.all, count.ended / std::max(now, 1e-3),
                           left < 0.0 ? "?" : base::FormatDuration(left), count.successes * percent,
                           count.collisions * percent),
               now);
  }

 private:
  const std::string what_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  base::ProgressLine line_;
};

/// Name of a policy in tables: its run's, or its file's if the file has a name of its own.
std::string AgentName(const std::string& policy_source) {
  const std::filesystem::path path(policy_source);
  const std::string run = path.parent_path().filename().string();
  return path.stem() == "policy" && !run.empty() ? run : path.stem().string();
}

}  // namespace

Scoring PreparePolicy(eval::MakeAgent make_agent, const policy::PolicySnapshot& policy,
                      const std::string& policy_source, const RunConfig& config,
                      const std::string& courses_spec, const std::optional<RunConfig>& trained) {
  policy::RequireSameInterface(policy_source, policy.spec,
                               sim::MakeObservationSpec(config.environment),
                               config.environment.action);
  if (config.mpc.enabled && policy.version < config.mpc.learning_starts) {
    spdlog::warn(
        "{}: has had {} updates of mpc.learning_starts = {}, so it is scored without planning",
        policy_source, policy.version, config.mpc.learning_starts);
  }
  const sim::CourseSet courses = config.courses.Resolve(courses_spec);
  Scoring scoring = Prepare(config, courses, std::move(make_agent),
                            {.agent = AgentName(policy_source),
                             .kind = "policy",
                             .source = policy_source,
                             .course_set = courses_spec});
  if (trained) {
    RunConfig training = *trained;
    training.courses.inputs = InputsOf(policy_source);
    scoring.training_overlap = FindTrainingOverlap(courses, training);
  }
  const auto& overlap = scoring.training_overlap;
  if (overlap && overlap->num_courses > 0) {
    spdlog::warn("{}: {}", policy_source, eval::DescribeOverlap(*overlap));
  }
  return scoring;
}

void RequireSameFieldOfView(const std::string& policy_source, const sim::EnvironmentConfig& trained,
                            const sim::EnvironmentConfig& task) {
  const double expected = trained.lidar.field_of_view;
  const double found = task.lidar.field_of_view;
  if (found == expected) return;
  throw base::Error(
      fmt::format("{}: environment.lidar.field_of_view is {} rad, expected {}, which the policy "
                  "was trained with: its beams would point elsewhere",
                  policy_source, found, expected));
}

Scoring PreparePlanner(const std::string& name, const AgentRunConfig& config,
                       const std::string& courses_spec, base::ParallelFor& parallel) {
  eval::MakeAgent make_agent = MakePlanners(name, config.planners, parallel);
  return Prepare(config, config.courses.Resolve(courses_spec), std::move(make_agent),
                 {.agent = name, .kind = "planner", .source = name, .course_set = courses_spec});
}

eval::Provenance ProvenanceOf(const Scoring& scoring) {
  eval::Provenance provenance = scoring.provenance;
  provenance.agent += scoring.guard;
  return provenance;
}

std::optional<Scores> Score(const Scoring& scoring, base::ParallelFor& parallel,
                            std::stop_token stop) {
  const sim::Physics& physics = scoring.task.physics;
  eval::Provenance provenance = ProvenanceOf(scoring);
  EpisodeProgress progress(fmt::format("{} on {}{}", provenance.agent, provenance.course_set,
                                       physics.make_bodies ? " in " + physics.name : ""));
  auto evaluation = eval::EvaluateOnCourses(
      scoring.task, scoring.make_agent, &parallel,
      [&progress](const eval::EpisodeCount& count) { progress.Show(count); }, std::move(stop));
  if (!evaluation) return std::nullopt;
  evaluation->training_overlap = scoring.training_overlap;
  return Scores{std::move(*evaluation), std::move(provenance)};
}

void WarnOfTrainingOverlap(const sim::CourseSet& scored, const RunConfig& training) {
  if (const auto overlap = FindTrainingOverlap(scored, training);
      overlap && overlap->num_courses > 0) {
    spdlog::warn("policies will be scored on {}: {}", scored.name, eval::DescribeOverlap(*overlap));
  }
}

}  // namespace slalom::train
