#pragma once

#include <cstdint>

#include "policy/policy.h"

namespace slalom::learner {

/// Where a learner's policies go: to the actor of this process, or over the network to whoever asks
/// (`PolicyServer`). Confined to the loop's thread.
class PolicySink {
 public:
  virtual ~PolicySink() = default;

  /// Hands out a policy in place of all earlier ones. `steps`: environment steps of the run so far.
  virtual void Publish(policy::PolicySnapshot snapshot, std::int64_t steps) = 0;

  /// Answers those who wait for a policy, without waiting. Once in each turn of the loop.
  virtual void Serve() {}
};

}  // namespace slalom::learner
