#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "env/action.h"
#include "env/agent.h"
#include "env/sensing/scan.h"
#include "planners/navigation/navigator.h"
#include "planners/planner_registry.h"

namespace slalom::planners {

/// Drives with a classical navigation system. Each environment has one `Navigator`, which sees
/// scan, goal vector and odometry, but no map of the course.
///
/// An episode's goal is where the goal vector of its first observation points; it stays fixed in
/// the odometry frame. The navigator gets poses in a frame C that has the same origin and in which
/// the robot starts at `navigation.start_heading`, so that this heading decides how the maps' cells
/// lie on the course. The planner's random numbers are seeded by a checksum of the first
/// observation, so an episode is the same at any index of any batch and on any number of threads.
/// Confined to one thread at a time. Allocates when the batch size changes.
class PlannerAgent : public env::Agent {
 public:
  /// `name`: one of `PlannerNames()`. `geometry` and `bounds` describe the environment's scans and
  /// actions, `step` is its control step, [s]. The navigators run on the threads of `parallel`,
  /// which must outlive this object, or on the caller's thread if it is null.
  ///
  /// Throws `base::Error` if there is no planner of this name.
  PlannerAgent(const std::string& name, const PlannersConfig& config,
               const env::ScanGeometry& geometry, const env::ActionBounds& bounds, double step,
               base::ParallelFor* parallel);
  ~PlannerAgent() override;

  /// Leaves the actions of ended episodes unchanged.
  /// Requires: observations.num_beams == geometry.num_beams; in the first call, and in a call with
  /// another batch size, first[i] is set for all i.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

  /// State, last command and counts of the navigator:
  ///
  ///     controlling v=0.50 w=-0.31 recoveries=0 no_plan=3 no_command=0 backwards=0 turns=12
  ///     cycles=640
  std::string Status(int i) const override;

  /// The navigation system of environment i.
  /// Requires: 0 <= i < the batch size of the last `Act`.
  const Navigator& navigator(int i) const { return *navigators_[i]; }

 private:
  void ActOne(int i, const env::ObservationBatch& observations, env::Action& action);
  std::unique_ptr<Navigator> MakeNavigator() const;

  const std::string name_;
  const PlannersConfig config_;
  const env::ScanGeometry geometry_;
  const env::ActionBounds bounds_;
  const double step_;  // [s]
  base::ParallelFor* const parallel_;
  std::vector<std::unique_ptr<Navigator>> navigators_;  // [B]
};

}  // namespace slalom::planners
