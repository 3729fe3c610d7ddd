#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>

namespace slalom::cli {

enum class VideoFormat { kGif, kWebm, kMp4 };

/// What is encoded.
struct VideoFrames {
  int width = 0;               ///< [pixels], even.
  int height = 0;              ///< The same.
  int frames_per_second = 25;  ///< A GIF can say 100, 50, 33, 25, 20 and so on alone.
  int num_frames = 0;
  /// Picture `i`: height x width pixels of four bytes, blue, green, red and one without a meaning.
  /// May be called more than once for a picture.
  std::function<std::span<const std::byte>(int i)> draw;
};

/// The bytes of a file that plays the frames, a GIF for ever. The program `ffmpeg` makes it, as a
/// child process; nothing touches the disk.
///
/// Throws `base::Error` where there is no `ffmpeg` (naming Debian's package and what needs none) or
/// where it fails, with its first words. Requires: num_frames >= 1.
std::string EncodeVideo(VideoFormat format, const VideoFrames& frames);

}  // namespace slalom::cli
