#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/random.h"
#include "planners/mppi/control_sequence.h"
#include "planners/mppi/mppi_config.h"
#include "planners/mppi/mppi_critics.h"
#include "planners/mppi/rollouts.h"
#include "planners/navigation/clearance_map.h"
#include "planners/navigation/local_path.h"
#include "planners/navigation/local_planner.h"

namespace slalom::planners {

/// Model predictive path integral control (Williams et al. 2017, 2018), with the critics and the
/// sampling of Nav2's nav2_mppi_controller.
///
/// Differences from Nav2:
/// - A command acts at once, so the first step of the sequence is commanded. Nav2 expects one
///   period of latency and commands the second.
/// - Clearance comes from a distance field of the lethal cells, not from the costmap's inflation.
/// - If the softmax mean of rollouts on both sides of an obstacle collides, the best single rollout
///   is driven.
/// - Only free rollouts, and the way they drove, decide how far along the path the rollouts get
///   (`SurveyPath`).
/// - Obstacles count as static.
///
/// Commands depend only on the config, the seed of `Reset` and the views since then. Cost per
/// cycle: 0.7 ms for 1000 rollouts of 56 steps on one core (benchmarks/trajectory_bench.cc).
class MppiPlanner : public LocalPlanner {
 public:
  /// Throws `base::Error` if fields of `config` contradict each other.
  explicit MppiPlanner(const MppiConfig& config);

  void Reset(std::uint64_t seed) override;

  /// Returns nothing if all rollouts collide, even after the configured number of restarts.
  /// Requires: view.path_O is not empty.
  [[nodiscard]] std::optional<Twist> ComputeCommand(const LocalView& view) override;

  /// The sampled rollouts of the last cycle, for pictures and tests.
  const Rollouts& rollouts() const { return rollouts_; }
  /// The commands planned for the next cycles.
  const ControlSequence& sequence() const { return sequence_; }

 private:
  struct Cycle;  // Values that are constant during one control cycle.

  Cycle Prepare(const LocalView& view);
  void SampleControls();
  int ScoreRollouts(const Cycle& cycle);
  void UpdateSequence(const Cycle& cycle);
  bool MeanCollides(const Cycle& cycle);
  void TakeBestRollout();
  std::optional<Twist> Optimize(const Cycle& cycle);

  const MppiConfig config_;
  const DriveLimits limits_;
  const DiscOutline outline_;
  ClearanceMap clearance_;
  LocalPath local_path_;
  CriticPath path_;
  Rollouts rollouts_;
  Rollouts mean_;  // The single rollout of the sequence itself.
  ControlSequence sequence_;
  base::Random random_{0};
  std::vector<float> noise_;    // Standard normal draws.
  std::vector<float> costs_;    // [B]
  std::vector<float> weights_;  // [B]
  std::vector<char> collides_;  // [B]
};

}  // namespace slalom::planners
