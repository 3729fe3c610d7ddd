#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "policy/policy.h"

namespace slalom::learner {

/// A policy as a run saves it: averaged weights, config and provenance.
struct PolicyFile {
  std::int64_t version = 0;
  std::string bytes;
};
/// Makes the policy that the run would save now, with more metadata. May be called until the next
/// publication, on the loop's thread.
using ShippedPolicy = std::function<PolicyFile(nn::Metadata more)>;

/// The destination of a learner's policies: the actor of this process, or all who ask over the
/// network (`PolicyServer`). Confined to the loop's thread.
class PolicySink {
 public:
  virtual ~PolicySink() = default;

  /// Hands out policies in place of all earlier ones. `steps`: environment steps of the run so far.
  virtual void Publish(policy::PolicySnapshot acting, ShippedPolicy shipped,
                       std::int64_t steps) = 0;

  /// Answers the readers that wait for a policy, without waiting itself. The loop calls it once in
  /// each turn.
  virtual void Serve() {}
};

}  // namespace slalom::learner
