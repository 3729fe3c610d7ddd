#pragma once

#include <span>

#include "base/geometry.h"
#include "env/episode.h"
#include "env/observation.h"
#include "env/step_shape.h"

namespace slalom::env {

/// B environments that are stepped together. Confined to one thread at a time, though an
/// implementation may use more inside.
///
/// After an episode has ended, its environment stands still, with the last frame in
/// `observations()`, until `Reset` starts another episode. The caller decides which one.
class BatchEnvironment {
 public:
  virtual ~BatchEnvironment() = default;

  virtual int batch_size() const = 0;
  virtual int num_courses() const = 0;
  /// Whether every number from `num_courses()` on is a course as well: fresh ones without end.
  virtual bool has_fresh_courses() const { return false; }

  /// Starts an episode in environment `i`. On return its first frame is in `observations()`.
  virtual void Reset(int i, const EpisodeSpec& spec) = 0;

  /// Runs one control step in every environment with a running episode. Leaves the results of the
  /// others as they were.
  /// actions: [B, A], each number in [-1, 1]; results: [B].
  virtual void Step(std::span<const float> actions, std::span<StepResult> results) = 0;

  /// The current frame of each environment.
  virtual const ObservationBatch& observations() const = 0;

  /// The sizes of a step; those of a course unless overridden.
  virtual StepShape shape() const { return {observations().num_beams, observations().state_size}; }

  /// The true pose of the robot in environment `i`, for records and pictures, not for agents.
  virtual base::Pose2 robot_pose(int i) const = 0;

  /// The time on the clock of the moving obstacles in environment `i`, [s], for records only. It
  /// does not start at 0.
  virtual double motion_time(int i) const = 0;
};

}  // namespace slalom::env
