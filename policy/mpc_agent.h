#pragma once

#include <cstdint>
#include <memory>

#include "policy/mpc_config.h"
#include "policy/policy_agent.h"

/// Shapes: `S` action sequences, `T` steps of the horizon.

namespace slalom::policy {

/// Drives by planning: rolls action sequences around the policy's own through the transition model
/// that the policy carries, and weighs their first actions by return,
///
///     R_s = sum_t gamma^t alive_t r_t + gamma^T alive_T Q(s_T, pi(s_T)),
///
/// with alive_t the probability that no step before t terminated. In the first iteration the
/// actions of sequence s are a_t = clip(pi(s_t) + noise) on the way, without noise in sequence 0:
/// the policy's own. In later ones, and in `cem`, they are drawn around the last one's mean.
/// Sources: MPPI (Williams et al. 2017, equation 6 for the weights), CEM (Chua et al. 2018, §5),
/// docs/original-system.md, section 5.2; for its faults M1 and M2, section 5.3.
///
/// What it chooses depends on seed, policy and the frames it saw in the episode, not on its place
/// in a batch nor on what it chose before: its random numbers follow from the frame. So it has no
/// state to save. Confined to one thread at a time. Allocates when the batch size changes. Cost: S
/// T passes through actor and model and S through the critic, per iteration and environment.
class MpcAgent : public PolicyAgent {
 public:
  /// Throws `base::Error` that says what was expected where the policy carries no model and critic,
  /// or `config` contradicts itself.
  MpcAgent(const MpcConfig& config, PolicySnapshot snapshot, std::uint64_t seed);
  ~MpcAgent() override;

  void SetSnapshot(PolicySnapshot snapshot) override;

  /// Requires: observations of the policy's number of beams.
  void Act(const env::ObservationBatch& observations, std::span<env::Action> actions) override;

  const PolicySnapshot& snapshot() const override { return snapshot_; }

 private:
  struct Planner;

  const MpcConfig config_;
  const std::uint64_t seed_;
  PolicySnapshot snapshot_;
  std::unique_ptr<Planner> planner_;
};

}  // namespace slalom::policy
