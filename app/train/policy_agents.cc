#include "app/train/policy_agents.h"

#include "policy/policy_agent.h"

namespace slalom::train {

eval::MakeAgent MakeAgentsOf(const policy::PolicySnapshot& policy, const RunConfig& config) {
  return [policy, mpc = config.mpc, seed = SeedOf(config, "mpc of evaluations")](
             const sim::CourseEnvironments&) { return policy::MakePolicyAgent(policy, mpc, seed); };
}

}  // namespace slalom::train
