#pragma once

#include <cstdint>
#include <memory>

#include "env/agent.h"
#include "policy/mpc_config.h"
#include "policy/policy.h"

namespace slalom::policy {

/// An agent that drives by a policy, whose weights may be replaced while it drives.
class PolicyAgent : public env::Agent {
 public:
  /// Goes on with other weights of the same spec; what was seen stays.
  /// Requires: network, distribution, planning and observation spec are those it was made with.
  virtual void SetSnapshot(PolicySnapshot snapshot) = 0;

  virtual const PolicySnapshot& snapshot() const = 0;
};

/// The agent that `config` asks for: one that plans (`MpcAgent`) or the policy itself
/// (`NetworkAgent`). Throws `base::Error` as their constructors.
std::unique_ptr<PolicyAgent> MakePolicyAgent(PolicySnapshot snapshot, const MpcConfig& config,
                                             std::uint64_t seed);

}  // namespace slalom::policy
