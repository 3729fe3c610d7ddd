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
/// actions of sequence s are a_t = clip(pi(s_t) + noise) on the way. Sequence 0 has no noise: it is
/// the policy's own. In later iterations, and in `cem`, actions are drawn around the mean of the
/// last iteration. Sources: MPPI (Williams et al. 2017, equation 6 for the weights), CEM (Chua et
/// al. 2018, §5), docs/original-system.md, section 5.2; for its faults M1 and M2, section 5.3.
///
/// The action depends on the seed, the policy and the frames of the episode, but neither on the
/// place in a batch nor on earlier actions: random numbers follow from the frame. So the agent has
/// no state to save. Confined to one thread at a time. Allocates when the batch size changes. Cost:
/// S T passes through actor and model and S through the critic, per iteration and environment.
class MpcAgent : public PolicyAgent {
 public:
  /// Throws `base::Error` that says what was expected if the policy carries no model and critic,
  /// or `config` contradicts itself.
  MpcAgent(const MpcConfig& config, PolicySnapshot snapshot, std::uint64_t seed);
  ~MpcAgent() override;

  void SetSnapshot(PolicySnapshot snapshot) override;

  /// Requires: observations of the policy's number of beams.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

  const PolicySnapshot& snapshot() const override { return snapshot_; }

 private:
  struct Planner;

  const MpcConfig config_;
  const std::uint64_t seed_;
  PolicySnapshot snapshot_;
  std::unique_ptr<Planner> planner_;
};

}  // namespace slalom::policy
