#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>

#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "app/cli/training_results.h"
#include "app/train/begin_run.h"
#include "app/train/drive_actor.h"
#include "app/train/guarded.h"
#include "app/train/inputs.h"
#include "app/train/policy_agents.h"
#include "app/train/run_identity.h"
#include "app/train/run_rules.h"
#include "app/train/scoring.h"
#include "app/train/service_process.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "base/parallel.h"
#include "base/random.h"
#include "base/version.h"
#include "eval/service/evaluator_service.h"
#include "learner/service/learner_service.h"
#include "policy/policy_agent.h"
#include "replay/service/server.h"
#include "sim/environments.h"

/// The processes of the distributed service, each until a signal stops it.

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

/// Throws `base::Error` if the journal in `directory` is of another run than `config`. Records the
/// run if it is new.
void RequireRunOf(const fs::path& directory, const train::RunConfig& config) {
  const fs::path record = directory / "config.toml";
  if (!base::Exists(record)) {
    base::MakeDirectories(directory);
    base::WriteFileAtomically(record, config::ToToml(config));
    return;
  }
  const train::RunConfig begun = train::ReadRecordedConfig(base::ReadFile(record), record.string());
  const std::string keys =
      proto::DescribeDifference(train::ServiceIdentity(config), train::ServiceIdentity(begun));
  if (keys.empty()) return;
  throw base::Error(
      "{}: the replay data in this directory is of another run: {}; use another service.state, or "
      "the config that the run was begun with",
      directory.string(), keys);
}

/// Tells those who start the others where this process listens, which port 0 leaves open.
void WriteEndpoint(const train::ServiceProcess& process, const std::string& role,
                   const std::string& endpoint) {
  base::MakeDirectories(process.state());
  base::WriteFileAtomically(process.state() / (role + ".endpoint"), endpoint + "\n");
}

/// The share of one replay server in what all of them have together, rounded up.
std::int64_t ShareOf(const train::RunConfig& config, std::int64_t all) {
  const auto num_servers = static_cast<std::int64_t>(config.service.replay.size());
  return (all + num_servers - 1) / num_servers;
}

int RunReplay(const train::ServiceOptions& options) {
  StopSignals signals;
  train::ServiceProcess process(transport::Role::kReplay, options);
  const train::RunConfig& config = process.config();
  replay::ReplayServerConfig server_config = config.replay_server;
  const int shard = process.shard();
  const std::string place = shard == 0 ? "replay" : fmt::format("replay-{}", shard);
  if (server_config.directory.empty()) server_config.directory = process.state() / place;
  server_config.max_ahead_steps = ShareOf(config, server_config.max_ahead_steps);
  replay::ReplayServerSpec spec;
  spec.name = process.name();
  spec.endpoint =
      train::BindAddress(config.service.replay_bind, config.service.replay[std::size_t(shard)]);
  spec.security =
      transport::MakeServerSecurity(config.security, transport::Role::kReplay, spec.endpoint);
  spec.max_connections = config.service.max_connections;
  spec.table = config.replay;
  spec.table.capacity = ShareOf(config, config.replay.capacity);
  spec.shape = train::StepShapeOf(config);
  spec.spec_hash = process.spec_hash();
  spec.run = train::ServiceIdentity(config);
  spec.seed = static_cast<std::uint64_t>(config.run.seed);
  if (shard > 0) spec.seed = base::DeriveSeed(spec.seed, "replay", {std::uint64_t(shard)});
  spec.updates_per_step = config.run.updates_per_step;
  spec.batches_per_update = train::BatchesPerUpdate(config);
  spec.chunk_bytes = train::LargestChunkBytes(config);
  spec.learning_starts = ShareOf(config, config.run.learning_starts);
  spec.software = fmt::format("slalom {}", base::Version());
  RequireRunOf(server_config.directory, config);
  replay::ReplayServer server(server_config, spec, process.context(), process.registry());
  spdlog::info("listening at {}, journal in {}", server.endpoint(), server_config.directory);
  WriteEndpoint(process, place, server.endpoint());
  server.Run(signals.token());
  return base::kExitOk;
}

int RunLearner(const train::ServiceOptions& options) {
  StopSignals signals;
  train::ServiceProcess process(transport::Role::kLearner, options);
  const train::RunConfig& config = process.config();
  const std::string& place = config.learner_service.directory;
  const run::RunDirectory directory{place.empty() ? process.state() / "learner" : fs::path(place)};
  const bool resume = fs::exists(directory.config());
  if (!resume) train::RequireLearnable(config);
  train::ResolvedRun with_copies = process.config();
  if (resume) with_copies.ReadCopies(directory.inputs());
  learner::LearnerJob job;
  job.first = train::LoadFirstPolicy(with_copies);
  const train::Inputs inputs = train::ReadPolicies(with_copies);
  const run::RunLock lock =
      resume ? train::ResumeRun(directory, config) : train::BeginRun(directory, config);
  train::WriteInputs(inputs, directory.inputs());
  job.name = process.name();
  job.loop.run = {directory,
                  config.run,
                  config::ToToml(config),
                  std::string(base::Commit()),
                  run::Fence::OfEnvironment(),
                  /*has_goals=*/!config.task.is_own()};
  job.spec_hash = process.spec_hash();
  job.run = train::ServiceIdentity(config);
  job.replay = process.replays();
  job.table_rows = ShareOf(config, config.replay.capacity);
  job.policies.endpoint = train::BindAddress(config.service.learner_bind, config.service.learner);
  job.policies.max_connections = config.service.max_connections;
  job.policies.security = transport::MakeServerSecurity(config.security, transport::Role::kLearner,
                                                        job.policies.endpoint);
  learner::LearnerService learner(config.learner_service, config.method,
                                  train::MakePolicySpec(config), std::move(job), process.context(),
                                  process.registry());
  spdlog::info("policies at {}, run directory {}", learner.endpoint(), directory.root.string());
  WriteEndpoint(process, "learner", learner.endpoint());
  switch (learner.Run(signals.token())) {
    case learner::TrainingEnd::kUnsaved:
      return base::kExitError;
    case learner::TrainingEnd::kDiverged:
      return base::kExitDiverged;
    case learner::TrainingEnd::kLearnedNothing:
      return base::kExitLearnedNothing;
    case learner::TrainingEnd::kFinished:
    case learner::TrainingEnd::kWasFinished:
      WriteTrainingPage(directory);
      return base::kExitOk;
    case learner::TrainingEnd::kStopped:
      return base::kExitOk;
  }
  return base::kExitOk;
}

int RunActor(const train::ServiceOptions& options) {
  StopSignals signals;
  train::ServiceProcess process(transport::Role::kActor, options);
  const train::RunConfig& config = process.config();
  train::RequireCourses(config, "slalom actor");
  base::ParallelFor parallel(config.run.simulation_threads);
  sim::CourseEnvironments environments = train::MakeTrainingEnvironments(config, parallel);
  // Drives nothing before the learner's first policy takes its place.
  policy::PolicySnapshot first = policy::ZeroSnapshot(train::MakePolicySpec(config));
  if (!config.mpc.enabled) first = policy::WithoutPlanning(std::move(first));
  const auto agent =
      policy::MakePolicyAgent(std::move(first), config.mpc, train::SeedOf(config, "mpc"));
  train::DriveActor(process, environments, *agent, config.courses.DescribeTrain(), signals.token());
  return base::kExitOk;
}

int RunEvaluator(const train::ServiceOptions& options) {
  StopSignals signals;
  train::ServiceProcess process(transport::Role::kEvaluator, options);
  const train::RunConfig& config = process.config();
  train::RequireCourses(config, "slalom evaluator");
  const std::string& courses = config.evaluator_service.courses.empty()
                                   ? config.courses.test
                                   : config.evaluator_service.courses;
  base::ThrowIf(
      courses.empty(),
      "courses.test and evaluator_service.courses are empty, expected courses to score policies "
      "on");
  if (courses == config.courses.test) {
    spdlog::warn(
        "best.safetensors is chosen on {}, which is courses.test: its score there will be too "
        "good; set evaluator_service.courses to others, such as static-validation",
        courses);
  }
  const sim::CourseSet scored = config.courses.Resolve(courses);
  train::WarnOfTrainingOverlap(scored, config);
  base::ParallelFor parallel(config.run.simulation_threads);
  const policy::PolicySpec spec = train::MakePolicySpec(config);
  const proto::RunIdentity run = train::ServiceIdentity(config);
  const auto read_policy = [&](std::span<const std::byte> bytes) -> base::Result<eval::MakeAgent> {
    const auto snapshot = train::ReadPolicy(bytes, spec, run);
    if (!snapshot) return snapshot.failure();
    return train::Guarded(train::MakeAgentsOf(*snapshot, config), config.guard);
  };
  eval::EvaluatorIdentity identity;
  identity.name = process.name();
  identity.state_directory = process.state() / "evaluators" / process.name();
  identity.spec_hash = process.spec_hash();
  identity.course_set = courses;
  identity.replay = process.replay();
  identity.learner = process.learner();
  eval::EvaluatorService evaluator(
      config.evaluator_service,
      eval::ResolveEvaluation(config.evaluation, config.environment, scored), std::move(identity),
      read_policy, parallel, process.context(), process.registry());
  evaluator.Run(signals.token());
  return base::kExitOk;
}

void AddRole(CLI::App& app, int* exit_code, const std::string& name, const std::string& meaning,
             int (*run)(const train::ServiceOptions&)) {
  CLI::App* command = app.add_subcommand(name, meaning);
  auto options = std::make_shared<train::ServiceOptions>();
  command->add_option("--config", options->config, "TOML file, the same for all processes of a run")
      ->required();
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->add_option("--name", options->name,
                      "Name of this process among those of its role [service.name of the config]");
  command->footer(
      "Runs until SIGINT, SIGTERM or SIGHUP, then saves and ends within seconds. Started again, it "
      "continues.\n"
      "docs/operations.md explains a first run on a cluster.");
  command->callback([options, exit_code, run] { *exit_code = run(*options); });
}

}  // namespace

void AddServiceCommands(CLI::App& app, int* exit_code) {
  AddRole(app, exit_code, "replay",
          "Run the replay server: store what actors send, and give batches to the learner",
          RunReplay);
  AddRole(app, exit_code, "learner",
          "Run the learner: learn from the replay server's batches and publish policies",
          RunLearner);
  AddRole(app, exit_code, "actor",
          "Run an actor: drive training episodes and send them to the replay server", RunActor);
  AddRole(app, exit_code, "evaluator",
          "Run an evaluator: score the learner's policies, one after the other", RunEvaluator);
}

}  // namespace slalom::cli
