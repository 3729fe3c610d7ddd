#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "learner/loop/policy_sink.h"
#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/refusal_log.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "proto/transport/server.h"

namespace slalom::learner {

/// Hands policies to actors and evaluators: the acting one, with or without its transition model,
/// or the one that the run would save, as the reader asks. Each asks for one newer than it holds
/// and is answered as soon as there is one. So a slow reader gets only the newest policy, and
/// nothing queues, for any number of readers. Confined to one thread, which polls it.
class PolicyServer final : public PolicySink {
 public:
  /// `run`: goes with the policies for actors, which refuse those of another run. Throws
  /// `base::Error` if the endpoint cannot be bound.
  PolicyServer(transport::Context& context, const transport::ServerOptions& options,
               std::uint64_t spec_hash, const proto::RunIdentity& run, metrics::Registry& registry);

  /// Publishes policies as the bytes of policy files, and answers the readers that wait. Makes only
  /// the files that a reader asks for.
  void Publish(policy::PolicySnapshot acting, ShippedPolicy shipped, std::int64_t steps) override;
  void Serve() override { Poll(std::chrono::milliseconds(0)); }

  /// Answers requests, waiting for one no longer than `timeout`.
  void Poll(std::chrono::milliseconds timeout);

  /// The version of the acting policy that was published last; 0 before the first.
  std::int64_t version() const { return acting_ ? acting_->version : 0; }
  const std::string& endpoint() const { return server_.endpoint(); }
  /// The number of readers that were heard from in the last seconds, and the oldest version among
  /// those that they hold.
  int num_readers() const { return static_cast<int>(readers_.size()); }
  std::optional<std::int64_t> oldest_held() const;

 private:
  /// A policy as it is sent.
  struct Message {
    std::int64_t version = 0;
    transport::Frame header;
    transport::Frame payload;
  };
  enum Kind { kActing, kWithoutModel, kShipped };
  struct Reader {
    std::int64_t held_version = -1;
    Kind kind = kActing;
    bool waits = false;
    std::chrono::steady_clock::time_point heard_at;
  };

  Message MakeMessage(Kind kind);
  /// The newest policy of the kind that the reader asks for; null before the first.
  const Message* NewestFor(const Reader& reader);
  void Answer(transport::Server::Received& received);
  void Send(const transport::PeerId& peer, Reader& reader, const Message& message);
  void Refuse(const transport::PeerId& peer, proto::RefusalCode code, std::string text);
  void ForgetSilentReaders();

  transport::Server server_;
  const std::string run_;  // `proto::PrintIdentity`
  const std::uint64_t spec_hash_;
  metrics::Registry& registry_;
  std::optional<policy::PolicySnapshot> acting_;    // The last publication.
  ShippedPolicy shipped_;                           // Of the last publication.
  std::array<std::optional<Message>, 3> messages_;  // By kind; empty until a reader asks for it.
  std::int64_t steps_ = 0;
  std::int64_t published_ns_ = 0;
  std::map<transport::PeerId, Reader> readers_;
  std::optional<std::chrono::steady_clock::time_point> looked_at_;
  service::RefusalLog refusal_log_;
};

}  // namespace slalom::learner
