#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>

namespace slalom::cli {

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

/// Returns the bytes of a file that plays the frames; a GIF repeats without end. The program
/// `ffmpeg` encodes it in a child process. Nothing is written to disk.
///
/// Throws `base::Error` if there is no `ffmpeg` (the error names Debian's package and a format that
/// does not need it), or if it fails (with the first line of its message).
/// Requires: num_frames >= 1.
std::string EncodeVideo(VideoFormat format, const VideoFrames& frames);

}  // namespace slalom::cli
