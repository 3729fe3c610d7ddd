#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "learner/loop/policy_sink.h"
#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "proto/transport/server.h"

namespace slalom::learner {

/// Hands policies to actors and evaluators. Each asks for one newer than it holds and is answered
/// as soon as there is one. So a slow reader gets only the newest policy, and nothing queues, for
/// any number of readers. Confined to one thread, which polls it.
class PolicyServer final : public PolicySink {
 public:
  /// Throws `base::Error` if the endpoint cannot be bound.
  PolicyServer(transport::Context& context, const transport::ServerOptions& options,
               std::uint64_t spec_hash, metrics::Registry& registry);

  /// Publishes a policy as the bytes of a policy file, and answers the readers that wait.
  void Publish(policy::PolicySnapshot snapshot, std::int64_t steps) override;
  void Serve() override { Poll(std::chrono::milliseconds(0)); }

  /// Answers requests, waiting for one no longer than `timeout`.
  void Poll(std::chrono::milliseconds timeout);

  /// The version that was published last; 0 before the first.
  std::int64_t version() const { return version_.value_or(0); }
  const std::string& endpoint() const { return server_.endpoint(); }
  /// The number of readers that were heard from in the last seconds, and the oldest version among
  /// those that they hold.
  int num_readers() const { return static_cast<int>(readers_.size()); }
  std::optional<std::int64_t> oldest_held() const;

 private:
  struct Reader {
    std::int64_t held_version = -1;
    bool waits = false;
    std::chrono::steady_clock::time_point heard_at;
  };

  void Answer(transport::Server::Received& received);
  void Send(const transport::PeerId& peer, Reader& reader);
  void Refuse(const transport::PeerId& peer, proto::RefusalCode code, std::string text);
  void ForgetSilentReaders();

  transport::Server server_;
  const std::uint64_t spec_hash_;
  metrics::Registry& registry_;
  std::optional<std::int64_t> version_;  // Version of the published policy.
  transport::Frame header_;
  transport::Frame payload_;
  std::map<transport::PeerId, Reader> readers_;
  std::optional<std::chrono::steady_clock::time_point> looked_at_;
};

}  // namespace slalom::learner
