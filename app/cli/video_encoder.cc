#include "app/cli/video_encoder.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/child_process.h"
#include "base/error.h"

namespace slalom::cli {
namespace {

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
    throw base::Error(fmt::format("cannot make a video: {}", std::strerror(errno)));
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
  throw base::Error(fmt::format("ffmpeg failed (exit code {}): {}", exit_code,
                                text.empty() ? "no message" : text.substr(0, text.find('\n'))));
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

}  // namespace

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

}  // namespace slalom::cli
