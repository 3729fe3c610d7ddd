#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/geometry.h"
#include "env/sensing/scan.h"
#include "planners/navigation/footprint.h"
#include "planners/navigation/global_planner.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"
#include "planners/navigation/obstacle_map.h"
#include "planners/navigation/rotate_recovery.h"

/// Frames: `O` odometry, `R` the robot. Shapes: `N` beams.

namespace slalom::planners {

/// The state of a navigator.
enum class NavigatorState : std::uint8_t {
  kPlanning,     ///< Stands still, without a plan.
  kControlling,  ///< The local planner drives.
  kRecovering,   ///< Clears its maps or turns around.
  kAborted,      ///< Gave up, as all recoveries failed.
  kArrived,      ///< Is within the goal tolerance.
};

std::string_view ToString(NavigatorState state);

/// Counts of an episode's events, to tell kinds of failure apart. A value.
struct NavigatorRecord {
  int num_cycles = 0;           ///< Control cycles.
  int num_failed_plans = 0;     ///< Times the global planner found no way.
  int num_failed_commands = 0;  ///< Times the local planner found no admissible command.
  int num_recoveries = 0;       ///< Recovery behaviours begun.
  int num_backwards = 0;        ///< Cycles that commanded a negative speed.
  int num_turns_in_place = 0;   ///< Cycles that commanded a turn without a speed.
  Twist last_command;           ///< Command of the last control cycle.
};

/// The navigation system of one robot: ROS's move_base with a local and a global costmap, a global
/// planner, recoveries and a local planner.
///
/// In move_base control, planning and each map have a thread of their own, and wait for no other
/// (`MoveBase::executeCb`, `planThread`, `Costmap2DROS::mapUpdateLoop`). Here, in each control
/// cycle, the state machine acts on the maps and the plan as they were left a cycle ago; then the
/// maps are updated, and then the global planner plans. A scan enters the maps `scan_age` after it
/// was taken, at its own place, because costmap_2d's `ObstacleLayer` has its message filter wait
/// for transforms that much younger. If a step is longer than the maps' period, the maps are up to
/// date when the state machine acts.
///
/// If a robot acts on commands with a delay, the state machine is given the pose and the velocity
/// that the robot will have then, after the commands that are on their way. Confined to one thread
/// at a time.
class Navigator {
 public:
  /// `step`: time between two calls of `Step`, [s]. An activity with a configured rate runs in
  /// every round(1 / (rate * step))-th call. Requires: planner is not null, step > 0.
  Navigator(const NavigationConfig& config, const PlannerNavigationConfig& planner_config,
            const env::ScanGeometry& geometry, double step, std::unique_ptr<LocalPlanner> planner);

  /// Begins an episode with the robot at X_OR and a goal, and forgets everything before. `seed` is
  /// for the local planner.
  void Reset(const base::Pose2& X_OR, base::Vec2 goal_O, std::uint64_t seed);

  /// Returns the command until the next call. `ranges_cm`: the present scan, [N] [cm].
  Twist Step(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR, Twist velocity);

  /// Takes the present scan into the maps, in the place of a `Step`, and neither plans nor drives.
  void Look(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR);

  NavigatorState state() const { return state_; }
  const NavigatorRecord& record() const { return record_; }
  const Costmap& local_costmap() const { return local_map_.costmap(); }
  /// Requires: an episode was begun.
  const Costmap& global_costmap() const { return global_map_->costmap(); }
  /// The plan being followed, from near the robot to the goal; empty if there is none.
  std::span<const base::Vec2> path() const;

 private:
  enum class Trigger { kPlanning, kControlling };
  struct Motion {
    base::Pose2 X_OR;
    Twist velocity;
  };

  double now() const { return num_steps_ * step_; }
  bool Due(double rate) const;
  Motion AfterDelay(Motion motion) const;
  env::ScanRays& NewestScan();
  void UpdateMaps(const base::Pose2& X_OR);
  void SizeGlobalMap(base::Vec2 way);
  void SendGoal();
  void Act(const base::Pose2& X_OR, Twist velocity);
  void Control(const base::Pose2& X_OR, Twist velocity);
  void Recover(const base::Pose2& X_OR);
  void FinishRecovery();
  void MakePlan(const base::Pose2& X_OR);
  void Prune(base::Vec2 p_O);

  const NavigationConfig config_;
  const PlannerNavigationConfig planner_config_;
  const double step_;  // [s]
  const PaddedFootprint footprint_;
  const env::ScanProjector projector_;
  const std::unique_ptr<LocalPlanner> planner_;
  std::vector<env::ScanRays> scans_;  // Scans of the last steps, a ring as long as `scan_age`.
  ObstacleMap local_map_;
  std::optional<ObstacleMap> global_map_;  // Set by the first Reset.
  GlobalPlanner global_planner_;

  base::Vec2 goal_O_;
  std::int64_t num_steps_ = 0;  // Since the episode began.
  NavigatorState state_ = NavigatorState::kPlanning;
  Trigger trigger_ = Trigger::kPlanning;  // The failure that started the recoveries.
  int recovery_index_ = 0;
  std::optional<RotateRecovery> turn_;                     // The turn being made, if any.
  double last_plan_time_ = 0.0, last_command_time_ = 0.0;  // Patience counts from here, [s].
  double last_sent_time_ = 0.0;                            // Time of the last command, [s].
  CellWindow global_change_;                               // Since the last plan.
  std::vector<base::Vec2> path_O_;
  std::size_t path_begin_ = 0;  // The first point that the robot has not passed.
  bool path_is_new_ = false;
  Twist command_;
  std::vector<Twist> on_their_way_;  // Commands that the robot does not act on yet, oldest first.
  NavigatorRecord record_;
};

}  // namespace slalom::planners
