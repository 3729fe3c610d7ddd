#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "env/action.h"
#include "env/agent.h"
#include "planners/navigator.h"
#include "planners/planner_registry.h"
#include "planners/scan.h"

namespace slalom::planners {

/// Drives with a classical navigation system: one `Navigator` per environment, which sees scan,
/// goal vector and odometry, and no map of the course.
///
/// An episode's goal is where the goal vector of its first frame points, fixed in the odometry's
/// frame. What a planner draws is seeded by a checksum of the first frame, so an episode is the
/// same in any slot of any batch and on any number of threads. Confined to one thread at a time.
/// Allocates when the batch size changes.
class PlannerAgent : public env::Agent {
 public:
  /// `name`: one of `PlannerNames()`. `geometry`, `bounds`: of the environment's scans and actions;
  /// `step`: its control step, [s]. `parallel`: runs the navigators on its threads; null: on the
  /// caller's. It must outlive this object.
  ///
  /// Throws `base::Error` where there is no planner of this name.
  PlannerAgent(const std::string& name, const PlannersConfig& config, const ScanGeometry& geometry,
               const env::ActionBounds& bounds, double step, base::ParallelFor* parallel);
  ~PlannerAgent() override;

  /// Leaves the actions of ended episodes as they were.
  /// Requires: observations.num_beams == geometry.num_beams; the first call has first[i] set for
  /// all i, and so has one with another batch size.
  void Act(const env::ObservationBatch& observations, std::span<env::Action> actions) override;

  /// State, last command and counts of the navigator:
  ///
  ///     controlling v=0.50 w=-0.31 recoveries=0 no_plan=3 no_command=0 backwards=0 turns=12
  ///     cycles=640
  std::string Status(int i) const override;

  /// What environment i's navigation system is doing.
  /// Requires: 0 <= i < the batch size of the last `Act`.
  const Navigator& navigator(int i) const { return *navigators_[i]; }

 private:
  void ActOne(int i, const env::ObservationBatch& observations, env::Action& action);
  std::unique_ptr<Navigator> MakeNavigator() const;

  const std::string name_;
  const PlannersConfig config_;
  const ScanGeometry geometry_;
  const env::ActionBounds bounds_;
  const double step_;  // [s]
  base::ParallelFor* const parallel_;
  std::vector<std::unique_ptr<Navigator>> navigators_;  // [B]
};

}  // namespace slalom::planners
