#pragma once

#include <cstdint>

#include "policy/policy.h"

namespace slalom::learner {

/// The destination of a learner's policies: the actor of this process, or all who ask over the
/// network (`PolicyServer`). Confined to the loop's thread.
class PolicySink {
 public:
  virtual ~PolicySink() = default;

  /// Hands out a policy in place of all earlier ones. `steps`: environment steps of the run so far.
  virtual void Publish(policy::PolicySnapshot snapshot, std::int64_t steps) = 0;

  /// Answers the readers that wait for a policy, without waiting itself. The loop calls it once in
  /// each turn.
  virtual void Serve() {}
};

}  // namespace slalom::learner
