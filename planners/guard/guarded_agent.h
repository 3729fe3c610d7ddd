#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "env/action.h"
#include "env/agent.h"
#include "env/sensing/obstacle_tracker.h"
#include "planners/guard/guard_config.h"
#include "planners/guard/guide.h"
#include "planners/guard/shield.h"

namespace slalom::planners {

/// What a guard must know of the robots that it guards. A value.
struct GuardedRobot {
  RobotModel model;
  env::ScanGeometry scan;
  env::ActionBounds bounds;
  double step = 0.2;     ///< Control step, [s].
  GuidePlanner guide{};  ///< Needed for `guard.waypoints` alone.
};

/// Drives as another agent does, except that a guide shows it the way where it does not find one
/// (`Guide`), and that a shield checks each action (`Shield`), whichever of both is enabled.
/// Confined to one thread at a time. Allocates when the batch size changes.
class GuardedAgent : public env::Agent {
 public:
  GuardedAgent(std::unique_ptr<env::Agent> agent, const GuardConfig& config,
               const GuardedRobot& robot);

  /// Requires: observations.num_beams == robot.scan.num_beams; in the first call, and in a call
  /// with another batch size, first[i] is set for all i.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

  /// The agent's own status, with the number of actions that were changed in this episode.
  std::string Status(int i) const override;
  /// Whether the last action of environment i is not the agent's own.
  bool Intervened(int i) const override { return guards_[i].intervened; }

 private:
  struct Guard {
    std::optional<Shield> shield;
    std::optional<env::ObstacleTracker> tracker;
    std::unique_ptr<Guide> guide;
    std::optional<Twist> command;  // Of the guide, in place of the agent's.
    bool intervened = false;
    int num_interventions = 0, num_steps = 0;  // Of this episode.
  };

  Guard MakeGuard() const;
  const env::ObservationBatch& Guided(const env::ObservationBatch& observations);

  const std::unique_ptr<env::Agent> agent_;
  const GuardConfig config_;
  const GuardedRobot robot_;
  std::vector<Guard> guards_;    // [B]
  env::ObservationBatch shown_;  // What the agent sees if a guide has another goal for it.
};

}  // namespace slalom::planners
