#include "app/cli/video_encoder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
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
#include "base/error.h"

namespace slalom::cli {
namespace {

/// A file descriptor with an owner.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {
    if (fd_ < 0) {
      throw base::Error(fmt::format("cannot make a video: {}", std::strerror(errno)));
    }
  }
  ~Descriptor() { Close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return fd_; }
  void Close() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }

 private:
  int fd_;
};

int MakeMemoryFile() { return ::memfd_create("slalom", MFD_CLOEXEC); }

std::string Content(const Descriptor& file) {
  std::string content;
  std::array<char, 65536> bytes;
  ssize_t size = 0;
  while ((size = ::pread(file.get(), bytes.data(), bytes.size(),
                         static_cast<off_t>(content.size()))) > 0) {
    content.append(bytes.data(), static_cast<std::size_t>(size));
  }
  return content;
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

// What the child finds where: frames come in at 0, the file goes out at 3, a palette lies at 4.
constexpr int kOutput = 3;
constexpr int kPalette = 4;
constexpr int kFirstSpare = 16;  // Ours lie above these while the child's are put in their places.

/// Starts ffmpeg. The arguments say what becomes of what it reads.
pid_t Start(const std::vector<std::string>& arguments, int input, int output, int messages,
            int palette) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, messages, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, messages, STDERR_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, kOutput);
  if (palette >= 0) posix_spawn_file_actions_adddup2(&actions, palette, kPalette);
  std::vector<char*> pointers;
  pointers.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));
  }
  pointers.push_back(nullptr);
  pid_t child = -1;
  const int error =
      posix_spawnp(&child, pointers.front(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return child;
  if (error == ENOENT) {
    throw base::Error(
        "a video needs the program ffmpeg, which is not installed: apt-get install ffmpeg; an "
        "animation named *.svg needs none");
  }
  throw base::Error(fmt::format("ffmpeg cannot be started: {}", std::strerror(error)));
}

/// A descriptor above those that the child gets, of the same file.
int Above(int fd) {
  const int above = ::fcntl(fd, F_DUPFD_CLOEXEC, kFirstSpare);
  const int error = errno;
  ::close(fd);
  errno = error;
  return above;
}

/// What ffmpeg makes of the frames whose numbers are given.
std::string RunFfmpeg(const std::vector<std::string>& conversion, const VideoFrames& frames,
                      const std::vector<int>& numbers, int palette) {
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
  Descriptor ours(sockets[0]);
  Descriptor theirs(Above(sockets[1]));
  const Descriptor output(Above(MakeMemoryFile()));
  const Descriptor messages(Above(MakeMemoryFile()));
  const pid_t child = Start(arguments, theirs.get(), output.get(), messages.get(), palette);
  theirs.Close();
  for (const int i : numbers) {
    if (!Send(ours.get(), frames.draw(i))) break;  // It says below what is wrong.
  }
  ours.Close();
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  std::string content = Content(output);
  if (status == 0 && !content.empty()) return content;
  const std::string text = Content(messages);
  throw base::Error(
      fmt::format("ffmpeg failed (exit code {}): {}",
                  WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
                  text.empty() ? "it said nothing" : text.substr(0, text.find('\n'))));
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
      frames, Numbers(std::min(kNumLookedAt, frames.num_frames), frames.num_frames), -1);
  const Descriptor palette(Above(MakeMemoryFile()));
  SLALOM_CHECK_EQ(::write(palette.get(), colours.data(), colours.size()),
                  static_cast<ssize_t>(colours.size()));
  ::lseek(palette.get(), 0, SEEK_SET);
  return RunFfmpeg({"-f", "png_pipe", "-i", fmt::format("/proc/self/fd/{}", kPalette), "-lavfi",
                    "paletteuse=dither=none:diff_mode=rectangle", "-loop", "0", "-f", "gif"},
                   frames, all, palette.get());
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
                       frames, all, -1);
    case VideoFormat::kMp4:
      return RunFfmpeg({"-c:v", "libx264", "-crf", "21", "-pix_fmt", "yuv420p", "-movflags",
                        "+faststart", "-f", "mp4"},
                       frames, all, -1);
  }
  base::CheckFailed(__FILE__, __LINE__, "a video format that is none");
}

}  // namespace slalom::cli
