#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/random.h"
#include "planners/navigation/clearance_map.h"
#include "planners/navigation/local_path.h"
#include "planners/navigation/local_planner.h"
#include "planners/teb/band_optimizer.h"
#include "planners/teb/homotopy.h"
#include "planners/teb/teb_config.h"
#include "planners/teb/timed_band.h"

namespace slalom::planners {

/// Timed elastic bands (Roesmann et al. 2012, 2013, 2017), as in teb_local_planner: there is one
/// band for each way round the obstacles, each is optimised from cycle to cycle, and the robot
/// follows the cheapest.
///
/// Obstacles are the lethal cells of the costmap, as points; all count as static. Left out are
/// dynamic obstacles, the recovery from oscillation (a preferred turning direction), and footprints
/// other than a point in the optimiser.
///
/// Commands depend only on the config, the seed of `Reset` and the views since then. Cost per
/// cycle: a few milliseconds (benchmarks/trajectory_bench.cc).
class TebPlanner : public LocalPlanner {
 public:
  explicit TebPlanner(const TebConfig& config);
  TebPlanner(const TebPlanner&) = delete;
  TebPlanner& operator=(const TebPlanner&) = delete;

  void Reset(std::uint64_t seed) override;

  /// Returns nothing if no band was found or the chosen one is not free of collisions.
  /// Requires: view.path_O is not empty.
  [[nodiscard]] std::optional<Twist> ComputeCommand(const LocalView& view) override;

  /// The bands of the last cycle, beginning with the one followed. For pictures and tests.
  std::vector<TimedBand> bands() const;

 private:
  struct Candidate {
    TimedBand band;
    HomotopyClass homotopy;
    double cost = 0.0;
    bool is_plans = false;  // Whether it has the class of the global plan.
  };
  struct Cycle;  // Values that are constant during one control cycle.

  Cycle Prepare(const LocalView& view);
  void CutPlan(const LocalView& view);
  void FindObstacles(const LocalView& view);
  void MoveBands(const Cycle& cycle);
  void ExploreClasses(const Cycle& cycle);
  void AddIfNew(const Cycle& cycle, std::span<const base::Vec2> points, bool is_plans);
  void OptimizeBands(const Cycle& cycle);
  void ChooseBand();
  void DropDetours();
  bool IsFeasible(const Cycle& cycle, const TimedBand& band) const;
  std::optional<Twist> GiveUp();

  const TebConfig config_;
  const DiscOutline outline_;
  ClearanceMap clearance_;
  BandOptimizer optimizer_;
  ObstacleGroups groups_;
  base::Random random_{0};

  std::vector<Candidate> candidates_;  // The first is the one that is followed.
  bool follows_first_ = false;         // candidates_[0] was chosen in the last cycle.
  double since_switch_ = 0.0;          // [s]
  double since_infeasible_ = 0.0;      // [s]
  int num_infeasible_ = 0;             // Cycles in a row.

  // Valid during a cycle.
  LocalPath plan_;
  double goal_yaw_ = 0.0;
  std::vector<base::Vec2> obstacles_O_;
  std::vector<base::Vec2> via_points_O_;
};

}  // namespace slalom::planners
