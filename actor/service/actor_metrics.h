#pragma once

#include <string>
#include <string_view>

#include "actor/actor.h"
#include "actor/service/ledger.h"
#include "actor/service/outbox.h"
#include "metrics/registry.h"
#include "proto/policy_link.h"
#include "proto/replay_link.h"

namespace slalom::actor {

/// The metrics of an actor process, updated from the counts of its parts. Confined to one thread.
class ActorMetrics {
 public:
  ActorMetrics(metrics::Registry& registry, std::string course_set, std::int64_t outbox_limit,
               int num_environments);

  /// Updates all metrics. It is cheap enough to be called every second.
  void Update(const StepAccount& account, const Outbox& outbox, const ActorStats& episodes,
              service::ReplayLink& replay, service::PolicyLink& policy);

  void AddBlocked(std::string_view queue, double seconds);
  void AddSent(int steps, bool again);
  void AddAcknowledged(int chunks);
  void AddRefused(std::string_view reason);
  void AddPolicyInstalled(double latency_s);
  /// Notes that the actor's loop turns.
  void AddTurn() { registry_.Beat(); }
  /// Sets the missing thing that the actor waits for, or null. It becomes the registry's fault,
  /// which the health check shows.
  void SetObstacle(const char* obstacle);

 private:
  metrics::Registry& registry_;
  const std::string course_set_;
};

}  // namespace slalom::actor
