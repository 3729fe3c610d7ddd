#include "app/train/scored_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "sim/pictures/course_render.h"

namespace slalom::cli {
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

}  // namespace

std::optional<ScoredRun> RunScored(const PreparedRun& prepared, base::ParallelFor& parallel,
                                   std::stop_token stop) {
  const sim::Physics& physics = prepared.task.physics;
  EpisodeProgress progress(fmt::format("{} on {}{}", prepared.provenance.agent,
                                       prepared.provenance.course_set,
                                       physics.make_bodies ? " in " + physics.name : ""));
  auto evaluation = eval::EvaluateOnCourses(
      prepared.task, prepared.make_agent, &parallel,
      [&progress](const eval::EpisodeCount& count) { progress.Show(count); }, std::move(stop));
  if (!evaluation) return std::nullopt;
  evaluation->training_overlap = prepared.training_overlap;
  return ScoredRun{std::move(*evaluation), prepared.provenance};
}

void WriteScoredRun(const ScoredRun& run, const std::filesystem::path& directory) {
  eval::WriteReports(run.evaluation, run.provenance, directory);

  const auto& courses = run.evaluation.task.courses.courses;
  const std::span<const sim::EpisodeTrack> tracks = run.evaluation.episodes.tracks;
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
