#pragma once

#include <string>
#include <string_view>

#include "actor/actor.h"
#include "actor/service/ledger.h"
#include "actor/service/outbox.h"
#include "metrics/registry.h"
#include "service/policy_link.h"
#include "service/replay_link.h"

namespace slalom::actor {

/// The figures of an actor process, kept up from what its parts count. Confined to one thread.
class ActorMetrics {
 public:
  ActorMetrics(metrics::Registry& registry, std::string course_set, std::int64_t outbox_limit,
               int num_environments);

  /// Brings everything up to date; cheap enough for every second.
  void Update(const StepAccount& account, const Outbox& outbox, const ActorStats& episodes,
              service::ReplayLink& replay, service::PolicyLink& policy);

  void AddBlocked(std::string_view queue, double seconds);
  void AddSent(int steps, bool again);
  void AddAcknowledged(int chunks);
  void AddRefused(std::string_view reason);
  void AddPolicyInstalled(double latency_s);
  /// What it waits for that should be there, which is the registry's fault; null: nothing.
  void SetObstacle(const char* obstacle);

 private:
  metrics::Registry& registry_;
  const std::string course_set_;
};

}  // namespace slalom::actor
