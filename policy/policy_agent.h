#pragma once

#include <cstdint>
#include <memory>

#include "env/agent.h"
#include "policy/mpc_config.h"
#include "policy/policy.h"

namespace slalom::policy {

/// An agent that drives by a policy. The weights may be replaced while it drives.
class PolicyAgent : public env::Agent {
 public:
  /// Replaces the weights by others of the same spec; the frames seen so far stay.
  /// Requires: network, distribution, planning and observation spec are those it was made with.
  virtual void SetSnapshot(PolicySnapshot snapshot) = 0;

  virtual const PolicySnapshot& snapshot() const = 0;
};

/// The agent that `config` asks for: one that plans (`MpcAgent`) or the policy itself
/// (`NetworkAgent`). Throws `base::Error` as their constructors do.
std::unique_ptr<PolicyAgent> MakePolicyAgent(PolicySnapshot snapshot, const MpcConfig& config,
                                             std::uint64_t seed);

}  // namespace slalom::policy
