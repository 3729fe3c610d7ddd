#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/course_selection.h"
#include "app/cli/output.h"
#include "app/cli/video_encoder.h"
#include "base/error.h"
#include "base/file.h"
#include "sim/courses/course_sets.h"
#include "sim/courses/episode_file.h"
#include "sim/pictures/animation.h"
#include "sim/pictures/animation_frames.h"
#include "sim/pictures/animation_svg.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

/// The options of `animate`.
struct AnimateOptions {
  CourseSelection selection;  ///< Courses chosen from the sets in `specs`.
  std::vector<std::string> specs;
  std::vector<std::string> episode_files;
  std::vector<int> episodes;  ///< Numbers; empty: all.
  std::string output;
  std::optional<std::string> format;
  std::optional<int> frames_per_second;
  bool force = false;
  sim::AnimationOptions shown;
};

std::string FormatOf(const AnimateOptions& options) {
  const std::string extension = fs::path(options.output).extension().string();
  const std::string format = options.format ? "." + *options.format : extension;
  for (const char* known : {".svg", ".gif", ".webm", ".mp4"}) {
    if (format == known) return format.substr(1);
  }
  throw base::Error(fmt::format(
      "{}: the animation's format is not clear; end the name in .svg, .gif, .webm or .mp4, or give "
      "--format",
      options.output));
}

/// The chosen courses of all sets, each name once.
sim::CourseSet ResolveAll(const AnimateOptions& options) {
  sim::CourseSet all;
  for (const std::string& spec : options.specs) {
    const sim::CourseSet set =
        sim::ResolveCourses(spec, options.selection.collection_path(), options.selection.seed);
    all.name += (all.name.empty() ? "" : ", ") + spec;
    for (const auto& course : set.courses) {
      const bool is_there =
          std::ranges::any_of(all.courses, [&](const auto& c) { return c->name == course->name; });
      if (!is_there) all.courses.push_back(course);
    }
  }
  const std::string source = all.name;
  return options.selection.Choose(std::move(all), source);
}

/// The tracks of all files; of the numbers that are asked for.
std::vector<sim::EpisodeTrack> ReadTracks(const AnimateOptions& options) {
  std::vector<sim::EpisodeTrack> tracks;
  for (const std::string& file : options.episode_files) {
    std::vector<sim::EpisodeTrack> more = sim::ReadEpisodes(file);
    std::move(more.begin(), more.end(), std::back_inserter(tracks));
  }
  if (!options.episodes.empty()) {
    std::erase_if(tracks, [&](const sim::EpisodeTrack& track) {
      return std::ranges::find(options.episodes, track.episode) == options.episodes.end();
    });
  }
  return tracks;
}

std::string EncodeFrames(const sim::Animation& animation, VideoFormat format,
                         int frames_per_second) {
  sim::AnimationFrames pictures(animation);
  VideoFrames frames;
  frames.width = pictures.width();
  frames.height = pictures.height();
  frames.frames_per_second = frames_per_second;
  frames.num_frames =
      std::max(1, static_cast<int>(std::ceil(animation.loop_time() * frames_per_second - 1e-6)));
  frames.draw = [&](int i) {
    return pictures.Draw(static_cast<double>(i) / static_cast<double>(frames_per_second));
  };
  return EncodeVideo(format, frames);
}

std::string Encode(const sim::Animation& animation, const AnimateOptions& options,
                   const std::string& format) {
  if (format == "svg") {
    if (options.frames_per_second) {
      throw base::Error(
          "--fps: an .svg has no frames and moves as smoothly as its viewer draws; "
          "leave it out");
    }
    return sim::PrintAnimationSvg(animation);
  }
  if (format == "gif") {
    return EncodeFrames(animation, VideoFormat::kGif, options.frames_per_second.value_or(20));
  }
  return EncodeFrames(animation, format == "webm" ? VideoFormat::kWebm : VideoFormat::kMp4,
                      options.frames_per_second.value_or(30));
}

void Animate(const AnimateOptions& options) {
  const std::string format = FormatOf(options);
  RequireOutputFile(options.output, options.force);
  const sim::CourseSet set = ResolveAll(options);
  const std::string source =
      fmt::format("{}{}", options.episode_files.front(),
                  options.episode_files.size() > 1
                      ? fmt::format(" and {} more", options.episode_files.size() - 1)
                      : "");
  const sim::Animation animation =
      sim::PlaceAnimation(sim::MakePanels(set, ReadTracks(options), source), options.shown);
  const std::string bytes = Encode(animation, options, format);
  base::WriteFileAtomically(options.output, bytes);
  std::size_t num_drives = 0;
  for (const sim::AnimationPanel& panel : animation.panels) num_drives += panel.tracks.size();
  fmt::print(stderr, "{}: {} drive{} in {} panel{}, {:.1f} s, {} kB\n", options.output, num_drives,
             num_drives == 1 ? "" : "s", animation.panels.size(),
             animation.panels.size() == 1 ? "" : "s", animation.loop_time(),
             (bytes.size() + 999) / 1000);
}

}  // namespace

void AddAnimateCommand(CLI::App& courses) {
  CLI::App* command = courses.add_subcommand(
      "animate", "Play recorded drives on their courses as SVG, GIF, WebM or MP4");
  auto options = std::make_shared<AnimateOptions>();
  command->add_option("--courses", options->specs, CourseSpecHelp() + " (repeatable)")->required();
  command->add_option("--course", options->selection.names,
                      "Show only this course of the sets (repeatable)");
  command
      ->add_option(
          "--episodes", options->episode_files,
          "File of recorded episodes: the evaluation-tracks.jsonl of an evaluation (repeatable)")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--episode", options->episodes,
                      "Show only the episodes with this number (repeatable)");
  command->add_option("--output", options->output, "File to write")->required();
  command->add_flag("--force", options->force, kForceHelp);
  command
      ->add_option("--format", options->format, "svg, gif, webm or mp4 [as the output's name ends]")
      ->check(CLI::IsMember({"svg", "gif", "webm", "mp4"}));
  command
      ->add_option("--speed", options->shown.speed, "Playback speed; 2 is twice as fast as driven")
      ->check(CLI::Range(0.05, 100.0))
      ->capture_default_str();
  command->add_option("--columns", options->shown.num_columns, "Courses side by side")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command->add_option("--width", options->shown.width, "Largest width of the picture [pixels]")
      ->check(CLI::Range(200.0, 4000.0))
      ->capture_default_str();
  command
      ->add_option("--around", options->shown.around,
                   "Show only what lies within this many metres of a drive [whole courses]")
      ->check(CLI::Range(0.5, 1000.0));
  command->add_option("--hold", options->shown.hold, "How long the last picture stays [s]")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  command
      ->add_option("--fps", options->frames_per_second,
                   "Pictures per second of a GIF [20] or a video [30]")
      ->check(CLI::Range(1, 60));
  command->add_flag("--lidar", options->shown.shows_scans,
                    "Show the readings of the LiDAR if they were recorded");
  options->selection.AddSource(*command);
  command->footer(
      "An .svg needs nothing else and plays in a README; the other formats are made by the program "
      "ffmpeg (apt-get\ninstall ffmpeg). Examples:\n\n"
      "  slalom evaluate --policy runs/fast/policy.safetensors --courses static-test --output out\n"
      "  slalom courses animate --courses static-test --course static-1-250 --episodes "
      "out/evaluation-tracks.jsonl \\\n      --output drive.svg\n");
  command->callback([options] { Animate(*options); });
}

}  // namespace slalom::cli
