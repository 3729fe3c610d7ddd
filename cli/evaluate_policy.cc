#include "cli/evaluate_policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "cli/version.h"
#include "policy/network_agent.h"
#include "sim/course_render.h"

namespace slalom::cli {
namespace {

constexpr std::size_t kMaxPictures = 60;
constexpr int kPictureColumns = 10;

/// Shows how many episodes have ended, at what rate, and the time left.
class EpisodeProgress {
 public:
  explicit EpisodeProgress(const std::string& what) : what_(what) {}

  void Show(int num_ended, int num_episodes) {
    const double now =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const double left = num_ended > 0 ? now * (num_episodes - num_ended) / num_ended : -1.0;
    line_.Show(
        fmt::format("{}: {} of {} episodes ({:.0f}/s)  left {}", what_, num_ended, num_episodes,
                    num_ended / std::max(now, 1e-3), left < 0.0 ? "?" : base::FormatDuration(left)),
        now);
  }

 private:
  const std::string what_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  base::ProgressLine line_;
};

}  // namespace

std::optional<PolicyEvaluation> EvaluatePolicy(const policy::PolicySnapshot& policy,
                                               const std::string& policy_source,
                                               const train::RunConfig& config,
                                               const std::string& courses_spec,
                                               base::ParallelFor& parallel, std::stop_token stop) {
  policy::RequireSameInterface(policy_source, policy.spec,
                               sim::MakeObservationSpec(config.environment),
                               config.environment.action);
  sim::CourseSet courses = config.courses.Resolve(courses_spec);
  EpisodeProgress progress(courses_spec);
  auto evaluation = eval::EvaluateOnCourses(
      config.evaluation, config.environment, courses,
      [&policy](int) { return std::make_unique<policy::NetworkAgent>(policy); }, &parallel,
      [&progress](int ended, int all) { progress.Show(ended, all); }, stop);
  if (!evaluation) return std::nullopt;
  return PolicyEvaluation{std::move(courses), std::move(*evaluation),
                          eval::Provenance{policy_source, courses_spec, config.courses.collection,
                                           std::string(Commit())}};
}

void WriteEvaluation(const PolicyEvaluation& result, const std::filesystem::path& directory) {
  eval::WriteReports(result.evaluation, result.provenance, directory);

  const auto& courses = result.courses.courses;
  const std::span<const sim::EpisodeTrack> tracks = result.evaluation.episodes.tracks;
  // Tracks are ordered by course, so those of one course stand together.
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

}  // namespace slalom::cli
