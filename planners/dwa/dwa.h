#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "planners/dwa/command_rollouts.h"
#include "planners/dwa/dwa_config.h"
#include "planners/navigation/distance_grid.h"
#include "planners/navigation/footprint.h"
#include "planners/navigation/local_planner.h"

namespace slalom::planners {

/// The dynamic window approach (Fox, Burgard, Thrun 1997) as in ROS's TrajectoryPlannerROS (`dwa:
/// true`, for a robot that cannot drive sideways).
///
/// It samples speeds and turn rates that can be reached within a control cycle, simulates each for
/// `sim_time`, rejects those whose outline hits an obstacle, and takes the one of least cost. The
/// cost is a weighted sum of the end's distance from the path, the end's distance from the local
/// goal (the last cell of the path on the map), and the highest costmap value under the outline on
/// the way. A turn on the spot wins a tie; among turns, the one that is best `heading_lookahead`
/// ahead wins. If nothing is admissible, the robot backs up, unchecked, until it has moved.
///
/// With `meter_scoring`, the weights of the two distances are multiplied by the map's resolution,
/// and the weight of the costmap's value is not (`TrajectoryPlannerROS::initialize` and
/// `TrajectoryPlanner::reconfigure` of base_local_planner, melodic 1.16.7; versions before
/// navigation's pull request 1000 multiply it, too). docs/planners.md gives the evidence for it.
///
/// Inflated cells under the robot are exempt in the distances to the path alone, as
/// `TrajectoryPlanner::findBestPath` (base_local_planner) marks them `within_robot` in `path_map_`
/// and not in `goal_map_`. A robot whose middle is in such a cell is therefore cut off from the
/// goal and gets no command. Confined to one thread at a time.
class DwaPlanner : public LocalPlanner {
 public:
  DwaPlanner(const DwaConfig& config, const FootprintConfig& footprint);

  void Reset(std::uint64_t seed) override;
  std::optional<Twist> ComputeCommand(const LocalView& view) override;

  /// A sampled command and its cost.
  struct Trajectory {
    static constexpr double kHits = -1.0;   ///< Cost if the outline hits something.
    static constexpr double kNoWay = -2.0;  ///< Cost if the end is cut off from path or goal.

    Twist command;
    double cost = kHits;
    base::Pose2 end;  ///< The last simulated pose.

    bool admissible() const { return cost >= 0.0; }
  };

  /// Simulates and scores one command against the view of the last `ComputeCommand`.
  Trajectory Score(const LocalView& view, Twist command);

 private:
  struct Window {
    Twist min, max;
  };

  bool MeasureDistances(const LocalView& view);
  Window DynamicWindow(const LocalView& view) const;
  Trajectory BestAhead(const LocalView& view, const Window& window);
  Trajectory BestOnTheSpot(const LocalView& view, const Window& window, const Trajectory& ahead);
  Trajectory BackUp(const LocalView& view);
  void NoteTurn(const LocalView& view, const Trajectory& best);
  void ForgetTurns(const LocalView& view);
  void EndEscape(const LocalView& view);
  bool MayCost(const LocalView& view, std::size_t i, double limit);
  Trajectory ScoreRollout(const LocalView& view, std::size_t i, double limit);
  std::optional<double> DistanceCost(const Costmap& costmap, base::Vec2 p_O);

  const DwaConfig config_;
  const PaddedFootprint footprint_;
  DistanceGrid to_path_, to_goal_;
  std::vector<CellIndex> under_robot_, path_cells_;
  base::Vec2 local_end_O_;       // The last point of the path that is near enough to count.
  std::vector<Twist> commands_;  // Of the rollouts.
  CommandRollouts rollouts_;
  std::vector<std::pair<double, std::size_t>> candidates_;  // Cost without the outline's; command.

  // Directions turned on the spot since the robot last moved on, and directions given up: after two
  // turns to one side, the robot may not turn to the other.
  bool turned_left_ = false, turned_right_ = false;
  bool no_left_ = false, no_right_ = false;
  base::Vec2 last_turn_O_;  // Where the robot last turned on the spot.
  bool escaping_ = false;
  base::Pose2 X_OE_;  // Where the escape began.
};

}  // namespace slalom::planners
