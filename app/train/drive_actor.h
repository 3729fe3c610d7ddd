#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>

#include "actor/service/ledger.h"
#include "app/train/service_process.h"
#include "env/environment.h"
#include "policy/policy_agent.h"
#include "proto/run_identity.h"

namespace slalom::train {

/// Runs the actor of `process` until `stop`: `agent`, which starts with any policy of the run's
/// spec (without what planning needs, if it does not plan), drives `environments` by the learner's
/// policies, and their rows go to the replay server. `course_set`: what is driven, for metrics.
/// `between`: as `ActorService::Run`. Returns the steps that were made. Throws as
/// `actor::ActorService`.
actor::StepAccount DriveActor(ServiceProcess& process, env::BatchEnvironment& environments,
                              policy::PolicyAgent& agent, std::string course_set,
                              std::stop_token stop, const std::function<void()>& between = {});

/// Reads a policy that came as bytes. Fails if it cannot drive as `spec` says, or says that it is
/// of another run than `run`. Leaves out its transition model if `spec` has none.
base::Result<policy::PolicySnapshot> ReadPolicy(std::span<const std::byte> bytes,
                                                const policy::PolicySpec& spec,
                                                const proto::RunIdentity& run);

}  // namespace slalom::train
