#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "sim/pictures/animation.h"

namespace slalom::sim {

/// Draws an animation frame by frame, for a video. Confined to one thread.
class AnimationFrames {
 public:
  /// `animation` must outlive this. Throws `Error` if there is no memory for a picture of this
  /// size.
  explicit AnimationFrames(const Animation& animation);
  ~AnimationFrames();
  AnimationFrames(const AnimationFrames&) = delete;
  AnimationFrames& operator=(const AnimationFrames&) = delete;

  int width() const;   ///< [pixels], even.
  int height() const;  ///< The same.

  /// The picture `time` [s] into the playback: height x width pixels, row by row from the top, each
  /// blue, green, red and a byte without a meaning. Good until the next call. Requires: time >= 0.
  std::span<const std::byte> Draw(double time);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::sim
