#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "transport/context.h"
#include "transport/frame.h"
#include "transport/server.h"

namespace slalom::learner {

/// Hands policies to actors and evaluators: each asks for one newer than that which it holds and is
/// answered at once, or when there is one. So a slow reader gets only the newest and nothing
/// queues, however many there are. Confined to one thread, which polls it.
class PolicyServer {
 public:
  /// Throws `base::Error` where the endpoint cannot be bound.
  PolicyServer(transport::Context& context, const transport::ServerOptions& options,
               std::uint64_t spec_hash, metrics::Registry& registry);

  /// Makes `policy`, a policy file's bytes, what readers get, and answers those that wait.
  void Publish(std::int64_t version, transport::Frame policy, std::int64_t learner_steps);

  /// Answers what was asked, waiting for a question no longer than `timeout`.
  void Poll(std::chrono::milliseconds timeout);

  const std::string& endpoint() const { return server_.endpoint(); }
  /// Readers heard of in the last seconds, and the oldest version that one of them holds.
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
  std::optional<std::int64_t> version_;  // Of what is published.
  transport::Frame header_;
  transport::Frame payload_;
  std::map<transport::PeerId, Reader> readers_;
  std::chrono::steady_clock::time_point looked_at_;
};

}  // namespace slalom::learner
