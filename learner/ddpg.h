#pragma once

#include "learner/actor_critic.h"
#include "learner/deterministic_actor.h"

namespace slalom::learner {

/// Deep Deterministic Policy Gradient (Lillicrap et al. 2016, algorithm 1), with n-step returns and
/// a weight-averaged actor as options.
class Ddpg : public ActorCritic<DeterministicActor> {
 public:
  explicit Ddpg(const AlgorithmContext& context) : ActorCritic(context, /*num_critics=*/1) {}

  void Update(double rate) override;
};

}  // namespace slalom::learner
