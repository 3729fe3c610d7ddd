#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/random.h"
#include "planners/clearance_map.h"
#include "planners/control_sequence.h"
#include "planners/local_path.h"
#include "planners/local_planner.h"
#include "planners/mppi_config.h"
#include "planners/mppi_critics.h"
#include "planners/rollouts.h"

namespace slalom::planners {

/// Model predictive path integral control (Williams et al. 2017, 2018), with the critics and the
/// sampling of Nav2's nav2_mppi_controller.
///
/// What differs from Nav2: a command acts at once, so the sequence's first step is commanded (Nav2
/// counts on a period of latency and commands the second); clearance comes from the lethal cells by
/// an own distance field, whatever the costmap's inflation; where the softmax mean of rollouts on
/// both sides of an obstacle meets it, the best single rollout is driven; how far along the path
/// the rollouts get is judged by those that are free and by the way they drove (see `SurveyPath`).
/// Obstacles count as static.
///
/// Commands are a function of (config, seed of `Reset`, views since). Cost per cycle: 0.7 ms
/// for 1000 rollouts of 56 steps on one core (benchmarks/trajectory_bench.cc).
class MppiPlanner : public LocalPlanner {
 public:
  /// Throws `base::Error` where fields of `config` contradict each other.
  explicit MppiPlanner(const MppiConfig& config);

  void Reset(std::uint64_t seed) override;

  /// None where all rollouts collide, after the configured fresh starts too.
  /// Requires: view.path_O is not empty.
  [[nodiscard]] std::optional<Twist> ComputeCommand(const LocalView& view) override;

  /// The sampled rollouts of the last cycle, for pictures and tests.
  const Rollouts& rollouts() const { return rollouts_; }
  /// What is to be commanded from the next cycle on.
  const ControlSequence& sequence() const { return sequence_; }

 private:
  struct Cycle;  // What holds during one control cycle.

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
  Rollouts mean_;  // One rollout: that of the sequence itself.
  ControlSequence sequence_;
  base::Random random_{0};
  std::vector<float> noise_;    // Standard normal draws.
  std::vector<float> costs_;    // [B]
  std::vector<float> weights_;  // [B]
  std::vector<char> collides_;  // [B]
};

}  // namespace slalom::planners
