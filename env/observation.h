#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"

/// Shapes: `B` environments in a batch, `N` beams in a scan, `S` = kStateSize.

namespace slalom::env {

/// The numbers of a frame beside the scan: goal x, goal y in the robot's frame (x forward, y left)
/// [m], then the last action (linear, angular), normalised to [-1, 1] with the action bounds.
inline constexpr int kStateSize = 4;

/// What one environment senses at one time step, as it is sensed, sent and stored. Views only.
struct FrameView {
  std::span<const std::uint16_t> ranges_cm;  ///< [N], beams counter-clockwise, clipped, [cm].
  std::span<const float, kStateSize> state;  ///< See kStateSize.
};

/// Where the robot believes to be and how it moves, as its wheels and its gyroscope tell. For
/// planners; not part of a stored frame. A value.
struct Odometry {
  base::Pose2 X_OR;      ///< In O, the frame that was the robot's own when the episode began.
  double linear = 0.0;   ///< Forward speed, [m/s].
  double angular = 0.0;  ///< Turn rate, [rad/s].

  friend bool operator==(const Odometry&, const Odometry&) = default;
};

/// The current frames of B environments. A value; reused from step to step, so nothing is
/// allocated.
struct ObservationBatch {
  int batch_size = 0;
  int num_beams = 0;
  std::vector<std::uint16_t> ranges_cm;  ///< [B, N] [cm]
  std::vector<float> state;              ///< [B, S], see kStateSize.
  std::vector<Odometry> odometry;        ///< [B]
  std::vector<std::uint8_t> ended;       ///< [B], 1: last frame of an episode; no action is needed.
  std::vector<std::uint8_t> first;  ///< [B], 1: first frame of an episode; forget what was before.

  void Resize(int new_batch_size, int new_num_beams) {
    batch_size = new_batch_size;
    num_beams = new_num_beams;
    ranges_cm.assign(static_cast<std::size_t>(batch_size) * num_beams, 0);
    state.assign(static_cast<std::size_t>(batch_size) * kStateSize, 0.0f);
    odometry.assign(static_cast<std::size_t>(batch_size), Odometry{});
    first.assign(static_cast<std::size_t>(batch_size), 1);
    ended.assign(static_cast<std::size_t>(batch_size), 0);
  }

  FrameView frame(int i) const {
    const auto n = static_cast<std::size_t>(num_beams);
    return {std::span(ranges_cm).subspan(i * n, n),
            std::span(state).subspan(static_cast<std::size_t>(i) * kStateSize).first<kStateSize>()};
  }
  std::span<std::uint16_t> mutable_ranges(int i) {
    const auto n = static_cast<std::size_t>(num_beams);
    return std::span(ranges_cm).subspan(i * n, n);
  }
  std::span<float, kStateSize> mutable_state(int i) {
    return std::span(state).subspan(static_cast<std::size_t>(i) * kStateSize).first<kStateSize>();
  }
};

/// How a frame becomes the numbers that the paper's networks see (docs/original-system.md,
/// section 1.3). Part of what a policy is trained for: a policy refuses observations of another
/// spec.
struct ObservationSpec {
  int num_beams = 720;
  double range_clip = 5.0;  ///< [m]; ranges map 0 -> -1, range_clip -> +1.
  double goal_scale = 5.0;  ///< [m]; a goal coordinate g maps to g / goal_scale - 1.

  int size() const { return num_beams + kStateSize; }
  friend bool operator==(const ObservationSpec&, const ObservationSpec&) = default;
};

/// Writes the observation of the POMDP: [N + 4] float, ranges, goal, last action, mapped as `spec`
/// says. Requires: frame.ranges_cm.size() == spec.num_beams, observation.size() == spec.size().
void WriteObservation(const ObservationSpec& spec, const FrameView& frame,
                      std::span<float> observation);

}  // namespace slalom::env
