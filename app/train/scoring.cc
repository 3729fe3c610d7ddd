#include "app/train/scoring.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "app/train/inputs.h"
#include "app/train/training_overlap.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/version.h"
#include "policy/policy_agent.h"
#include "sim/pictures/course_render.h"

namespace slalom::train {
namespace {

constexpr std::size_t kMaxPictures = 60;
constexpr int kPictureColumns = 10;

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

/// `config`: a policy's or a planner's.
template <class Config>
Scoring Prepare(const Config& config, const sim::CourseSet& courses, eval::MakeAgent make_agent,
                eval::Provenance provenance) {
  provenance.collection = config.courses.collection;
  provenance.commit = base::Commit();
  provenance.config = config::ToToml(config);
  return {eval::ResolveEvaluation(config.evaluation, config.environment, courses),
          std::move(make_agent), std::move(provenance)};
}

}  // namespace

eval::MakeAgent MakeAgentsOf(const policy::PolicySnapshot& policy, const RunConfig& config) {
  return [policy, mpc = config.mpc, seed = SeedOf(config, "mpc of evaluations")](
             const sim::CourseEnvironments&) { return policy::MakePolicyAgent(policy, mpc, seed); };
}

Scoring PreparePolicy(const policy::PolicySnapshot& policy, const std::string& policy_source,
                      const RunConfig& config, const std::string& courses_spec,
                      const std::optional<RunConfig>& trained) {
  policy::RequireSameInterface(policy_source, policy.spec,
                               sim::MakeObservationSpec(config.environment),
                               config.environment.action);
  if (config.mpc.enabled && policy.version < config.mpc.learning_starts) {
    spdlog::warn(
        "{}: has had {} updates of mpc.learning_starts = {}, so it is scored without planning",
        policy_source, policy.version, config.mpc.learning_starts);
  }
  const sim::CourseSet courses = config.courses.Resolve(courses_spec);
  Scoring scoring = Prepare(config, courses, MakeAgentsOf(policy, config),
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

Scoring PreparePlanner(const std::string& name, const AgentRunConfig& config,
                       const std::string& courses_spec, base::ParallelFor& parallel) {
  eval::MakeAgent make_agent = MakePlanners(name, config.planners, parallel);
  return Prepare(config, config.courses.Resolve(courses_spec), std::move(make_agent),
                 {.agent = name, .kind = "planner", .source = name, .course_set = courses_spec});
}

std::optional<Scores> Score(const Scoring& scoring, base::ParallelFor& parallel,
                            std::stop_token stop) {
  const sim::Physics& physics = scoring.task.physics;
  EpisodeProgress progress(fmt::format("{} on {}{}", scoring.provenance.agent,
                                       scoring.provenance.course_set,
                                       physics.make_bodies ? " in " + physics.name : ""));
  auto evaluation = eval::EvaluateOnCourses(
      scoring.task, scoring.make_agent, &parallel,
      [&progress](const eval::EpisodeCount& count) { progress.Show(count); }, std::move(stop));
  if (!evaluation) return std::nullopt;
  evaluation->training_overlap = scoring.training_overlap;
  return Scores{std::move(*evaluation), scoring.provenance};
}

void WriteScores(const Scores& scores, const std::filesystem::path& directory) {
  eval::WriteReports(scores.evaluation, scores.provenance, directory);

  const auto& courses = scores.evaluation.task.courses.courses;
  const std::span<const sim::EpisodeTrack> tracks = scores.evaluation.episodes.tracks;
  // Tracks are ordered by course, so the tracks of one course stand together.
  std::vector<sim::CourseScene> scenes;
  std::size_t begin = 0;
  for (std::size_t course = 0; course < courses.size() && scenes.size() < kMaxPictures; ++course) {
    std::size_t end = begin;
    while (end < tracks.size() && tracks[end].course == courses[course]->name) ++end;
    scenes.push_back({courses[course].get(), tracks.subspan(begin, end - begin)});
    begin = end;
  }
  for (const auto format : {sim::PictureFormat::kPng, sim::PictureFormat::kSvg}) {
    const char* name = format == sim::PictureFormat::kPng ? "courses.png" : "courses.svg";
    base::WriteFileAtomically(directory / name,
                              sim::RenderContactSheet(scenes, kPictureColumns, format));
  }
}

void WarnOfTrainingOverlap(const sim::CourseSet& scored, const RunConfig& training) {
  if (const auto overlap = FindTrainingOverlap(scored, training);
      overlap && overlap->num_courses > 0) {
    spdlog::warn("policies will be scored on {}: {}", scored.name, eval::DescribeOverlap(*overlap));
  }
}

}  // namespace slalom::train
