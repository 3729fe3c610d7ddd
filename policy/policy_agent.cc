#include "policy/policy_agent.h"

#include <utility>

#include "policy/mpc_agent.h"
#include "policy/network_agent.h"

namespace slalom::policy {

std::unique_ptr<PolicyAgent> MakePolicyAgent(PolicySnapshot snapshot, const MpcConfig& config,
                                             std::uint64_t seed) {
  if (!config.enabled) return std::make_unique<NetworkAgent>(std::move(snapshot));
  return std::make_unique<MpcAgent>(config, std::move(snapshot), seed);
}

}  // namespace slalom::policy
