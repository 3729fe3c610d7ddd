#include "app/train/service_process.h"

#include <cstdint>
#include <cstdlib>
#include <utility>

#include "base/child_process.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/name.h"
#include "base/version.h"
#include "metrics/catalogue.h"
#include "policy/nn/kernels/blas_kernel.h"
#include "proto/transport/security.h"

namespace slalom::train {
namespace {

std::string ChooseName(transport::Role role, const ServiceConfig& config,
                       const ServiceOptions& options) {
  std::string name = options.name.value_or(config.name);
  if (name.empty()) {
    const bool is_many = role == transport::Role::kActor || role == transport::Role::kEvaluator;
    name = is_many ? base::HostName() : std::string(transport::ToString(role));
  }
  base::ThrowIf(
      !base::IsName(name) || name.starts_with('.'),
      "service.name is '{}', expected 1 to {} letters, digits or '-_.:@', not beginning with '.'",
      name, base::kMaxNameBytes);
  return name;
}

/// Starts of this process before this one, counted in a file of its state directory. 0 if the file
/// cannot be kept: the process starts all the same.
double CountEarlierStarts(const std::filesystem::path& state, std::string_view role,
                          const std::string& name) {
  const std::filesystem::path directory = state / "starts";
  const std::filesystem::path path = directory / fmt::format("{}-{}", role, name);
  try {
    base::MakeDirectories(directory);
    const double earlier =
        std::filesystem::exists(path) ? std::atof(base::ReadFile(path).c_str()) : 0.0;
    base::WriteFileAtomically(path, fmt::format("{:.0f}\n", earlier + 1.0));
    return earlier;
  } catch (const base::Error& error) {
    spdlog::warn("starts are not counted: {}", error.what());
    return 0.0;
  }
}

/// The number with which a name ends, of its last 18 digits at most; nothing if it ends with none.
std::optional<std::uint64_t> NumberAtEnd(std::string_view name) {
  std::uint64_t number = 0;
  std::uint64_t place = 1;
  int digits = 0;
  while (digits < 18 && !name.empty() && name.back() >= '0' && name.back() <= '9') {
    number += place * static_cast<std::uint64_t>(name.back() - '0');
    place *= 10;
    ++digits;
    name.remove_suffix(1);
  }
  return digits == 0 ? std::nullopt : std::optional(number);
}

ResolvedRun LoadConfig(const ServiceOptions& options) {
  return Resolve(config::Load<RunConfig>(options.config, options.overrides), {.serves = true});
}

}  // namespace

ServiceProcess::ServiceProcess(transport::Role role, const ServiceOptions& options)
    : role_(role),
      config_(LoadConfig(options)),
      name_(ChooseName(role, config_.service, options)),
      shard_(role == transport::Role::kReplay
                 ? ServerShard(name_, static_cast<int>(config_.service.replay.size()))
                 : ShardOf(name_, static_cast<int>(config_.service.replay.size()))),
      context_(config_.service.io_threads),
      registry_(std::make_unique<metrics::Registry>(
          MakeIdentity(std::string(transport::ToString(role)), name_, config_.run.name))) {
  registry_->counter(metrics::kRestarts)
      .Increment(CountEarlierStarts(state(), transport::ToString(role), name_));
  spdlog::info("slalom {} {}, {} '{}'", base::Version(), transport::ToString(role),
               transport::ToString(role), name_);
  if (!config_.service.metrics.empty()) exposer_ = ShowMetrics(config_.service.metrics, *registry_);
  if (!config_.service.health.empty()) {
    health_ = std::make_unique<metrics::Exposer>(config_.service.health, *registry_);
  }
}

transport::ClientOptions ServiceProcess::replay() const {
  return replays()[static_cast<std::size_t>(shard_)];
}

std::vector<transport::ClientOptions> ServiceProcess::replays() const {
  std::vector<transport::ClientOptions> options;
  for (const std::string& endpoint : config_.service.replay) {
    options.push_back({.endpoint = endpoint,
                       .security = transport::MakeClientSecurity(
                           config_.security, role_, transport::Role::kReplay, endpoint)});
  }
  return options;
}

transport::ClientOptions ServiceProcess::learner() const {
  const std::string& endpoint = config_.service.learner;
  return {.endpoint = endpoint,
          .security = transport::MakeClientSecurity(config_.security, role_,
                                                    transport::Role::kLearner, endpoint)};
}

int ShardOf(std::string_view name, int num_shards) {
  const auto count = static_cast<std::uint64_t>(num_shards);
  const auto number = NumberAtEnd(name);
  return static_cast<int>(number.value_or(base::Checksum(name)) % count);
}

int ServerShard(const std::string& name, int num_shards) {
  const std::uint64_t number = NumberAtEnd(name).value_or(0);
  base::ThrowIf(num_shards > 1 && number >= static_cast<std::uint64_t>(num_shards),
                "the replay server is named '{}', expected a name that ends with its place among "
                "the {} of service.replay, counted from 0",
                name, num_shards);
  return num_shards == 1 ? 0 : static_cast<int>(number);
}

metrics::Identity MakeIdentity(std::string role, std::string name, std::string run) {
  return {.role = std::move(role),
          .name = std::move(name),
          .run = std::move(run),
          .version = std::string(base::Version()),
          .commit = std::string(base::Commit()),
          .blas_kernel = nn::BlasKernel()};
}

std::unique_ptr<metrics::Exposer> ShowMetrics(const std::string& address,
                                              metrics::Registry& registry) {
  auto exposer = std::make_unique<metrics::Exposer>(address, registry);
  spdlog::info("metrics at http://{}:{}/metrics", address.substr(0, address.rfind(':')),
               exposer->port());
  return exposer;
}

const std::string& BindAddress(const std::string& bind, const std::string& reached) {
  return bind.empty() ? reached : bind;
}

}  // namespace slalom::train
