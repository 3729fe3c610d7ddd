#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/train/resolved_run.h"
#include "metrics/exposer.h"
#include "metrics/registry.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"

namespace slalom::train {

/// The options of every process of the service.
struct ServiceOptions {
  std::optional<std::string> config;
  std::vector<std::string> overrides;
  std::optional<std::string> name;
};

/// The common parts of the service's processes: config, name, context of the sockets, metrics.
/// Confined to the main thread.
class ServiceProcess {
 public:
  /// Loads the config and serves metrics at the address that it names. Throws `base::Error` if the
  /// config or the address is unusable.
  ServiceProcess(transport::Role role, const ServiceOptions& options);

  const ResolvedRun& config() const { return config_; }
  const std::string& name() const { return name_; }
  std::filesystem::path state() const { return config_.service.state; }
  std::uint64_t spec_hash() const { return SpecHash(config_); }
  transport::Context& context() { return context_; }
  metrics::Registry& registry() { return *registry_; }

  /// The place in `service.replay` of the server that this process is, or sends to (`ShardOf`).
  int shard() const { return shard_; }

  /// Options for connecting to the servers with this role's keys: to its own replay server, to all
  /// in the order of `service.replay`, and to the learner.
  transport::ClientOptions replay() const;
  std::vector<transport::ClientOptions> replays() const;
  transport::ClientOptions learner() const;

 private:
  const transport::Role role_;
  const ResolvedRun config_;
  const std::string name_;
  const int shard_;
  transport::Context context_;
  std::unique_ptr<metrics::Registry> registry_;
  std::unique_ptr<metrics::Exposer> exposer_;
  std::unique_ptr<metrics::Exposer> health_;
};

/// Returns the place, of `num_shards` in `service.replay`, of the replay server that a process of
/// this name sends to: the number with which the name ends, modulo `num_shards`, so that actors
/// counted from 0 or 1 are shared evenly, or else one that follows from the name's checksum.
int ShardOf(std::string_view name, int num_shards);

/// Returns the place in `service.replay` of the replay server of this name: the number with which
/// the name ends, or 0 if it ends with none. Throws `base::Error` if there is no such place.
int ServerShard(const std::string& name, int num_shards);

/// Returns the identity of this program in this role, for its metrics. `run`: `run.name`.
metrics::Identity MakeIdentity(std::string role, std::string name, std::string run);

/// Shows the metrics at `address` and logs the address (`metrics::Exposer`, with its errors).
std::unique_ptr<metrics::Exposer> ShowMetrics(const std::string& address,
                                              metrics::Registry& registry);

/// Returns the address at which a server listens: `bind` or, if that is empty, the address to which
/// the others connect.
const std::string& BindAddress(const std::string& bind, const std::string& reached);

}  // namespace slalom::train
