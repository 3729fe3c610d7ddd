#pragma once

#include <span>

#include "base/geometry.h"
#include "env/action.h"
#include "env/episode.h"
#include "env/observation.h"

namespace slalom::env {

/// B environments stepped together. Confined to one thread at a time (an implementation may use
/// more inside).
///
/// An environment whose step ended its episode stands still, with its last frame in
/// `observations()`, until `Reset` starts another: whoever drives decides which episode comes next.
class BatchEnvironment {
 public:
  virtual ~BatchEnvironment() = default;

  virtual int batch_size() const = 0;
  virtual int num_courses() const = 0;

  /// Starts an episode in environment `i`; its first frame is in `observations()` on return.
  virtual void Reset(int i, const EpisodeSpec& spec) = 0;

  /// Runs every environment whose episode is running for one control step. Results of environments
  /// without a running episode are left as they were.
  /// Requires: actions.size() == results.size() == batch_size().
  virtual void Step(std::span<const Action> actions, std::span<StepResult> results) = 0;

  /// The current frame of each environment.
  virtual const ObservationBatch& observations() const = 0;

  /// Ground truth of environment `i`, for records and pictures, not for agents.
  virtual base::Pose2 robot_pose(int i) const = 0;

  /// Time on the clock that the moving obstacles of environment `i` follow, [s], which does not
  /// start at 0; likewise for records only.
  virtual double motion_time(int i) const = 0;
};

}  // namespace slalom::env
