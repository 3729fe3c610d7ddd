#include "app/train/local_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <system_error>
#include <utility>

#include "app/train/command_options.h"
#include "app/train/run_identity.h"
#include "app/train/trained_policy.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "learner/run/run_directory.h"
#include "proto/transport/keys.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kTimeToEnd{30};  // For the others, once one has ended.
constexpr std::chrono::seconds kQuickly{10};
constexpr int kMostQuickEnds = 5;

/// Writes new keys into `directory`, in place of earlier ones.
void RenewKeys(const fs::path& directory) {
  std::error_code ec;
  fs::remove_all(directory, ec);
  transport::WriteNewKeys(directory);
}

/// The config of all processes, with new keys. Everything in it that names a place is the service's
/// own.
RunConfig ConfigOfService(const LocalServiceOptions& options) {
  const fs::path root = fs::absolute(options.directory);
  base::MakeDirectories(root);
  RenewKeys(root / "keys");
  RunConfig config = options.config;
  config.security = {};
  config.security.keys = (root / "keys").string();
  // Sockets of the abstract namespace: no file stays behind, and no port has to be free. The name
  // follows from a key that was just drawn.
  const std::string address =
      fmt::format("ipc://@slalom-{}",
                  Digest(transport::LoadPublicKey(config.security.keys, transport::Role::kReplay)));
  std::vector<std::string> replay = {address + "-replay"};
  for (int i = 1; i < options.num_replay_servers; ++i) {
    replay.push_back(fmt::format("{}-replay-{}", address, i));
  }
  config.service = {.replay = std::move(replay),
                    .learner = address + "-learner",
                    .metrics = config.service.metrics,
                    .state = root.string(),
                    .io_threads = config.service.io_threads};
  config.replay_server.directory = "";
  config.learner_service.directory = fs::absolute(options.run).string();
  config.learner_service.exit_when_finished = true;
  return config;
}

/// Runs a process of a service.
std::vector<std::string> ServiceCommand(const fs::path& program, const std::string& role,
                                        const fs::path& config, const std::string& name) {
  return {program.string(), role, kConfigOption, config.string(), kNameOption, name};
}

}  // namespace

LocalService::LocalService(const LocalServiceOptions& options)
    : options_(options),
      service_config_(ConfigOfService(options)),
      config_file_(options.directory / "service.toml") {
  base::WriteFileAtomically(config_file_, config::ToToml(service_config_));
  Add("learner", "learner");
  Add("replay", "replay");
  for (int i = 1; i < options.num_replay_servers; ++i) Add("replay", fmt::format("replay-{}", i));
  for (int i = 1; i <= options.num_actors; ++i) Add("actor", fmt::format("actor-{}", i));
  if (options.evaluator) Add("evaluator", "evaluator");
  for (Member& member : members_) Start(member);
}

LocalService::~LocalService() = default;

void LocalService::Add(const std::string& role, const std::string& name) {
  const fs::path logs = options_.directory / "logs";
  if (options_.log.empty()) base::MakeDirectories(logs);
  members_.push_back(
      {.command = role == name ? "slalom " + role : fmt::format("slalom {} --name {}", role, name),
       .options = {.arguments = ServiceCommand(options_.program, role, config_file_, name),
                   .log = options_.log.empty() ? logs / (name + ".log") : options_.log,
                   .cores = options_.cores,
                   .environment = options_.environment}});
}

void LocalService::Start(Member& member) {
  member.exit_code.reset();
  member.started = Clock::now();
  member.process = std::make_unique<base::ChildProcess>(member.options);
}

std::optional<int> LocalService::Wait(std::chrono::milliseconds time) {
  for (Member& member : members_) {
    if (member.exit_code) continue;
    // The time passes at the first one that runs.
    member.exit_code = member.process->Wait(std::exchange(time, std::chrono::milliseconds(0)));
    if (member.exit_code && !exit_code_) LookAfter(member);
  }
  const bool runs = std::ranges::any_of(
      members_, [](const Member& member) { return !member.exit_code.has_value(); });
  if (!exit_code_ || (runs && (!deadline_ || Clock::now() < *deadline_))) return std::nullopt;
  return fault_.empty() ? *members_.front().exit_code : base::kExitError;
}

void LocalService::LookAfter(Member& member) {
  const int exit_code = *member.exit_code;
  const bool is_learner = &member == &members_.front();
  const bool is_over =
      is_learner && (exit_code == base::kExitDiverged || exit_code == base::kExitLearnedNothing ||
                     (exit_code == base::kExitOk && IsTrained()));
  if (is_over) return End(exit_code);
  if (exit_code != base::kExitOk && exit_code < base::kExitSignalBase) {
    fault_ = fmt::format("`{}` ended with exit code {}", member.command, exit_code);
    if (options_.log.empty()) fault_ += fmt::format("; {} says why", member.options.log.string());
    return End(exit_code);
  }
  const std::string how =
      exit_code == base::kExitOk
          ? "was stopped"
          : fmt::format("was ended by signal {}", exit_code - base::kExitSignalBase);
  member.num_quick_ends = Clock::now() - member.started < kQuickly ? member.num_quick_ends + 1 : 1;
  if (member.num_quick_ends >= kMostQuickEnds) {
    fault_ = fmt::format("`{}` {}, {} times in a row within {} s of its start", member.command, how,
                         member.num_quick_ends, kQuickly.count());
    return End(exit_code);
  }
  spdlog::warn("{}: `{}` {} and is started again", options_.run.string(), member.command, how);
  ++num_restarts_;
  Start(member);
}

void LocalService::End(int exit_code) {
  Signal(SIGTERM);
  exit_code_ = exit_code;
  deadline_ = Clock::now() + kTimeToEnd;
}

void LocalService::Signal(int signal) {
  if (!exit_code_) exit_code_ = base::kExitSignalBase + signal;
  for (Member& member : members_) member.process->Signal(signal);
}

bool LocalService::IsTrained() const {
  try {
    return IsAtLimit(ReadPolicyFigures(run::RunDirectory{options_.run}.policy()),
                     options_.config.run);
  } catch (const base::Error& error) {
    spdlog::warn("{}", error.what());
    return false;
  }
}

}  // namespace slalom::train
