#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/geometry.h"
#include "planners/footprint.h"
#include "planners/global_planner.h"
#include "planners/local_planner.h"
#include "planners/navigation_config.h"
#include "planners/obstacle_map.h"
#include "planners/rotate_recovery.h"
#include "planners/scan.h"

/// Frames: `O` odometry, `R` the robot. Shapes: `N` beams.

namespace slalom::planners {

/// What a navigator is doing.
enum class NavigatorState : std::uint8_t {
  kPlanning,     ///< Stands, without a plan.
  kControlling,  ///< The local planner drives.
  kRecovering,   ///< Clears its maps or turns round.
  kAborted,      ///< Gave up: all recoveries failed.
  kArrived,      ///< Within the goal tolerance.
};

std::string_view ToString(NavigatorState state);

/// What happened in an episode, to tell classes of failure apart. A value.
struct NavigatorRecord {
  int num_cycles = 0;           ///< Control cycles.
  int num_failed_plans = 0;     ///< The global planner found no way.
  int num_failed_commands = 0;  ///< The local planner found no admissible command.
  int num_recoveries = 0;       ///< Behaviours begun.
  int num_backwards = 0;        ///< Cycles that commanded a negative speed.
  int num_turns_in_place = 0;   ///< Cycles that commanded a turn without a speed.
  Twist last_command;           ///< Of the last control cycle.
};

/// The navigation system of one robot: ROS's move_base with a local and a global costmap, a global
/// planner, recoveries and a local planner.
///
/// In each control cycle the maps take in the scan, the state machine acts, and then the global
/// planner plans, whose plan is used from the next cycle on, as with move_base's planner thread.
/// Confined to one thread at a time.
class Navigator {
 public:
  /// `step`: time between two calls of `Step`, [s]; rates of the configs are met by acting in every
  /// round(1 / (rate step))-th call. Requires: planner is not null, step > 0.
  Navigator(const NavigationConfig& config, const PlannerNavigationConfig& planner_config,
            const ScanGeometry& geometry, double step, std::unique_ptr<LocalPlanner> planner);

  /// Begins an episode with the robot at X_OR and a goal; forgets all before. `seed`: for the local
  /// planner.
  void Reset(const base::Pose2& X_OR, base::Vec2 goal_O, std::uint64_t seed);

  /// The command from now to the next call. `ranges_cm`: the scan taken now, [N] [cm].
  Twist Step(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR, Twist velocity);

  NavigatorState state() const { return state_; }
  const NavigatorRecord& record() const { return record_; }
  const Costmap& local_costmap() const { return local_map_.costmap(); }
  /// Requires: an episode was begun.
  const Costmap& global_costmap() const { return global_map_->costmap(); }
  /// The plan that is being followed, from near the robot to the goal; empty without one.
  std::span<const base::Vec2> path() const;

 private:
  enum class Trigger { kPlanning, kControlling };

  double now() const { return num_steps_ * step_; }
  bool Due(double rate) const;
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
  const Footprint footprint_;
  const ScanProjector projector_;
  const std::unique_ptr<LocalPlanner> planner_;
  ObstacleMap local_map_;
  std::optional<ObstacleMap> global_map_;  // From the first Reset on.
  GlobalPlanner global_planner_;
  ScanRays rays_;

  base::Vec2 goal_O_;
  std::int64_t num_steps_ = 0;  // Since the episode began.
  NavigatorState state_ = NavigatorState::kPlanning;
  Trigger trigger_ = Trigger::kPlanning;  // Of the recoveries.
  int recovery_index_ = 0;
  std::optional<RotateRecovery> turn_;                     // Under way.
  double last_plan_time_ = 0.0, last_command_time_ = 0.0;  // Patience counts from here, [s].
  double last_sent_time_ = 0.0;                            // Of a command, [s].
  CellWindow global_change_;                               // Since the last plan.
  std::vector<base::Vec2> path_O_;
  std::size_t path_begin_ = 0;  // What is before it was passed.
  bool path_is_new_ = false;
  Twist command_;
  NavigatorRecord record_;
};

}  // namespace slalom::planners
