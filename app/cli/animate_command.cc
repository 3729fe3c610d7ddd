#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/course_selection.h"
#include "app/cli/output.h"
#include "base/check.h"
#include "base/child_process.h"
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

enum class VideoFormat { kGif, kWebm, kMp4 };

/// The pictures to be encoded.
struct VideoFrames {
  int width = 0;               ///< [pixels], even.
  int height = 0;              ///< [pixels], even.
  int frames_per_second = 25;  ///< A GIF can only have 100, 50, 33, 25, 20, ...
  int num_frames = 0;
  /// Returns picture `i`: height x width pixels of four bytes, which are blue, green, red and an
  /// unused one. It may be called more than once for a picture.
  std::function<std::span<const std::byte>(int i)> draw;
};

/// A socket with an owner.
class Socket {
 public:
  explicit Socket(int fd) : fd_(fd) {}
  ~Socket() { Close(); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  int get() const { return fd_; }
  void Close() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }

 private:
  int fd_;
};

base::ChildProcess StartFfmpeg(const base::ChildOptions& options) {
  try {
    return base::ChildProcess(options);
  } catch (const base::ProgramMissing&) {
    throw base::Error(
        "a video needs the program ffmpeg, which is not installed: apt-get install ffmpeg; an "
        "animation named *.svg needs none");
  }
}

/// Whether all of it arrived; false: the other side has closed.
bool Send(int socket, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t size = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(size));
  }
  return true;
}

// Descriptors of the child: frames come in at 0, the file goes out at 3, a palette lies at 4.
constexpr int kOutput = 3;
constexpr int kPalette = 4;

/// Returns the file that ffmpeg makes of the frames with these numbers.
std::string RunFfmpeg(const std::vector<std::string>& conversion, const VideoFrames& frames,
                      const std::vector<int>& numbers, const base::MemoryFile* palette = nullptr) {
  std::vector<std::string> arguments = {"ffmpeg",
                                        "-v",
                                        "error",
                                        "-nostdin",
                                        "-y",
                                        "-f",
                                        "rawvideo",
                                        "-pixel_format",
                                        "bgr0",
                                        "-video_size",
                                        fmt::format("{}x{}", frames.width, frames.height),
                                        "-framerate",
                                        fmt::format("{}", frames.frames_per_second),
                                        "-i",
                                        "pipe:0"};
  arguments.insert(arguments.end(), conversion.begin(), conversion.end());
  arguments.push_back(fmt::format("/proc/self/fd/{}", kOutput));
  std::array<int, 2> sockets{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets.data()) != 0) {
    throw base::Error("cannot make a video: {}", std::strerror(errno));
  }
  Socket ours(sockets[0]);
  Socket theirs(sockets[1]);
  const base::MemoryFile output;
  const base::MemoryFile messages;
  base::ChildOptions options{.arguments = std::move(arguments),
                             .files = {{theirs.get(), STDIN_FILENO},
                                       {messages.descriptor(), STDOUT_FILENO},
                                       {messages.descriptor(), STDERR_FILENO},
                                       {output.descriptor(), kOutput}}};
  if (palette != nullptr) options.files.emplace_back(palette->descriptor(), kPalette);
  base::ChildProcess child = StartFfmpeg(options);
  theirs.Close();
  for (const int i : numbers) {
    if (!Send(ours.get(), frames.draw(i))) break;  // Its messages have the reason.
  }
  ours.Close();
  const int exit_code = child.Wait();
  std::string content = output.Content();
  if (exit_code == 0 && !content.empty()) return content;
  const std::string text = messages.Content();
  throw base::Error("ffmpeg failed (exit code {}): {}", exit_code,
                    text.empty() ? "no message" : text.substr(0, text.find('\n')));
}

std::vector<int> Numbers(int count, int num_frames) {
  std::vector<int> numbers;
  numbers.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    numbers.push_back(
        count == 1 ? 0 : static_cast<int>(std::int64_t{i} * (num_frames - 1) / (count - 1)));
  }
  return numbers;
}

/// A GIF has 256 colours: they are chosen from some of the frames, the last among them, then used
/// for all.
std::string EncodeGif(const VideoFrames& frames, const std::vector<int>& all) {
  constexpr int kNumLookedAt = 12;
  const std::string colours = RunFfmpeg(
      {"-vf", "palettegen=stats_mode=full", "-frames:v", "1", "-c:v", "png", "-f", "image2pipe"},
      frames, Numbers(std::min(kNumLookedAt, frames.num_frames), frames.num_frames));
  const base::MemoryFile palette;
  SLALOM_CHECK_EQ(::write(palette.descriptor(), colours.data(), colours.size()),
                  static_cast<ssize_t>(colours.size()));
  ::lseek(palette.descriptor(), 0, SEEK_SET);
  return RunFfmpeg({"-f", "png_pipe", "-i", fmt::format("/proc/self/fd/{}", kPalette), "-lavfi",
                    "paletteuse=dither=none:diff_mode=rectangle", "-loop", "0", "-f", "gif"},
                   frames, all, &palette);
}

/// Returns the bytes of a file that plays the frames; a GIF repeats without end. The program
/// `ffmpeg` encodes it in a child process. Nothing is written to disk.
///
/// Throws `base::Error` if there is no `ffmpeg` (the error names Debian's package and a format that
/// does not need it), or if it fails (with the first line of its message).
/// Requires: num_frames >= 1.
std::string EncodeVideo(VideoFormat format, const VideoFrames& frames) {
  SLALOM_CHECK_GE(frames.num_frames, 1);
  const std::vector<int> all = Numbers(frames.num_frames, frames.num_frames);
  switch (format) {
    case VideoFormat::kGif:
      return EncodeGif(frames, all);
    case VideoFormat::kWebm:
      return RunFfmpeg({"-c:v", "libvpx-vp9", "-crf", "32", "-b:v", "0", "-deadline", "good",
                        "-cpu-used", "4", "-row-mt", "1", "-pix_fmt", "yuv420p", "-f", "webm"},
                       frames, all);
    case VideoFormat::kMp4:
      return RunFfmpeg({"-c:v", "libx264", "-crf", "21", "-pix_fmt", "yuv420p", "-movflags",
                        "+faststart", "-f", "mp4"},
                       frames, all);
  }
  base::CheckFailed(__FILE__, __LINE__, "a video format that is none");
}

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
  throw base::Error(
      "{}: the animation's format is not clear; end the name in .svg, .gif, .webm or .mp4, or give "
      "--format",
      options.output);
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
    base::ThrowIf(options.frames_per_second.has_value(),
                  "--fps: an .svg has no frames and moves as smoothly as its viewer draws; "
                  "leave it out");
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
