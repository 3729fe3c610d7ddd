#include "app/train/drive_actor.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "actor/service/actor_service.h"
#include "app/train/run_identity.h"
#include "base/error.h"
#include "policy/policy_spec.h"

namespace slalom::train {

actor::StepAccount DriveActor(ServiceProcess& process, env::BatchEnvironment& environments,
                              policy::PolicyAgent& agent, std::string course_set,
                              std::stop_token stop, const std::function<void()>& between) {
  const RunConfig& config = process.config();
  const policy::PolicySpec spec = agent.snapshot().spec;
  const proto::RunIdentity run = ServiceIdentity(config);
  const auto install = [&](std::span<const std::byte> bytes) -> std::optional<base::Failure> {
    auto snapshot = ReadPolicy(bytes, spec, run);
    if (!snapshot) return snapshot.failure();
    agent.SetSnapshot(std::move(*snapshot));
    return std::nullopt;
  };
  actor::ActorIdentity identity;
  identity.name = process.name();
  // Steps are accounted for with each replay server by itself.
  identity.state_directory = process.state() / "actors" / process.name();
  if (process.shard() > 0) {
    identity.state_directory /= fmt::format("replay-{}", process.shard());
  }
  identity.seed = static_cast<std::uint64_t>(config.run.seed);
  identity.spec_hash = process.spec_hash();
  identity.run = run;
  identity.course_set = std::move(course_set);
  identity.plans = spec.planning.is_carried();
  identity.replay = process.replay();
  identity.learner = process.learner();
  actor::ActorService actor(config.actor_service, config.actor, config.courses.sampling,
                            std::move(identity), environments, agent, install, process.context(),
                            process.registry());
  actor.Run(std::move(stop), between);
  return actor.account();
}

base::Result<policy::PolicySnapshot> ReadPolicy(std::span<const std::byte> bytes,
                                                const policy::PolicySpec& spec,
                                                const proto::RunIdentity& run) {
  try {
    auto [snapshot, metadata] = policy::ParsePolicy(bytes, "the policy received");
    const auto own = metadata.find(proto::kIdentityMetadata);
    if (own == metadata.end()) return base::Failure{"the policy received does not say its run"};
    const std::string keys = proto::DescribeDifference(proto::ParseIdentity(own->second), run);
    if (!keys.empty()) return base::Failure{"the policy received is of another run: " + keys};
    if (!spec.planning.is_carried()) snapshot = policy::WithoutPlanning(std::move(snapshot));
    policy::RequireSameSpec("the policy received", snapshot.spec, spec);
    return std::move(snapshot);
  } catch (const base::Error& error) {
    return base::Failure{error.what()};
  }
}

}  // namespace slalom::train
