#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "env/state_layout.h"

/// Shapes: `B` environments in a batch, `N` beams in a scan, `S` numbers of a state.

namespace slalom::env {

/// Observation of one environment at one time step, in the form in which it is sensed, sent and
/// stored. A view: it does not own the numbers.
struct FrameView {
  std::span<const std::uint16_t> ranges_cm;  ///< [N], beams counter-clockwise, clipped, [cm].
  std::span<const float> state;              ///< [S], on a course as kStateFields says.

  /// FNV-1a over the numbers: a seed for what must not depend on a place in a batch.
  std::uint64_t Checksum() const {
    std::uint64_t hash = 0xcbf29ce484222325u;
    const auto add = [&](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3u; };
    for (const std::uint16_t range : ranges_cm) add(range);
    for (const float value : state) add(std::bit_cast<std::uint32_t>(value));
    return hash;
  }
};

/// Where the robot believes it is and how it moves, according to its wheels and gyroscope. Planners
/// use it; it is not part of a stored frame. A value.
struct Odometry {
  base::Pose2 X_OR;      ///< In O, the frame of the robot when the episode began.
  double linear = 0.0;   ///< Forward speed of the body, or of the wheels if `from_wheels`, [m/s].
  double angular = 0.0;  ///< Turn rate, [rad/s].

  friend bool operator==(const Odometry&, const Odometry&) = default;
};

/// The current frames of B environments. A value that is reused from step to step, so that steps do
/// not allocate.
struct ObservationBatch {
  int batch_size = 0;
  int num_beams = 0;                     ///< N; 0 if there is no scan.
  int state_size = 0;                    ///< S
  std::vector<std::uint16_t> ranges_cm;  ///< [B, N] [cm]
  std::vector<float> state;              ///< [B, S], on a course as kStateFields says.
  std::vector<Odometry> odometry;        ///< [B]
  std::vector<std::uint8_t> ended;  ///< [B], 1 in the last frame of an episode: no action needed.
  std::vector<std::uint8_t> first;  ///< [B], 1 in the first frame of an episode: forget the past.

  void Resize(int new_batch_size, int new_num_beams, int new_state_size = kStateSize) {
    batch_size = new_batch_size;
    num_beams = new_num_beams;
    state_size = new_state_size;
    ranges_cm.assign(static_cast<std::size_t>(batch_size) * num_beams, 0);
    state.assign(static_cast<std::size_t>(batch_size) * state_size, 0.0f);
    odometry.assign(static_cast<std::size_t>(batch_size), Odometry{});
    first.assign(static_cast<std::size_t>(batch_size), 1);
    ended.assign(static_cast<std::size_t>(batch_size), 0);
  }

  FrameView frame(int i) const {
    const auto n = static_cast<std::size_t>(num_beams), s = static_cast<std::size_t>(state_size);
    return {std::span(ranges_cm).subspan(i * n, n), std::span(state).subspan(i * s, s)};
  }
  std::span<std::uint16_t> mutable_ranges(int i) {
    const auto n = static_cast<std::size_t>(num_beams);
    return std::span(ranges_cm).subspan(i * n, n);
  }
  std::span<float> mutable_state(int i) {
    const auto s = static_cast<std::size_t>(state_size);
    return std::span(state).subspan(i * s, s);
  }
};

/// How a frame becomes the numbers that the paper's networks see (docs/original-system.md,
/// section 1.3). A policy is trained for one spec and refuses observations of another.
struct ObservationSpec : StateOptions {
  int num_beams = 720;
  int state_size = kStateSize;
  double range_clip = 5.0;  ///< [m]; 0 is mapped to -1 and range_clip to +1.
  double goal_scale = 5.0;  ///< [m]; a goal coordinate g is mapped to g / goal_scale - 1.

  int size() const { return num_beams + state_size; }
  friend bool operator==(const ObservationSpec&, const ObservationSpec&) = default;
};

}  // namespace slalom::env
