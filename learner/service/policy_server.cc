#include "learner/service/policy_server.h"

#include <algorithm>
#include <utility>

#include "metrics/catalogue.h"

namespace slalom::learner {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Readers ask again within 5 s.
constexpr std::chrono::seconds kSilence{20};
// More peers than this are refused, so that endless new connections cannot exhaust memory.
constexpr std::size_t kMaxReaders = 65536;
// Requests answered before the caller gets its turn.
constexpr int kMaxAtOnce = 1024;

bool MayRead(std::optional<transport::Role> role) {
  return !role || *role == transport::Role::kActor || *role == transport::Role::kEvaluator ||
         *role == transport::Role::kOperator;
}

/// Options by which no reader has more than one policy under way, so that one that asks for each
/// and reads none costs no more.
transport::ServerOptions OneAtATime(transport::ServerOptions options) {
  options.max_queued_bytes = 0;
  return options;
}

}  // namespace

PolicyServer::PolicyServer(transport::Context& context, const transport::ServerOptions& options,
                           std::uint64_t spec_hash, const proto::RunIdentity& run,
                           metrics::Registry& registry)
    : server_(context, OneAtATime(options)),
      run_(proto::PrintIdentity(run)),
      spec_hash_(spec_hash),
      registry_(registry) {
  registry_.counter(metrics::kRejectedConnections);
  for (const transport::EndReason reason : transport::kEndReasons) {
    registry_.counter(metrics::kConnectionsEnded, {transport::ToString(reason)});
  }
  registry_.gauge(metrics::kServerConnections);
  registry_.gauge(metrics::kServerConnectionsLimit).Set(server_.max_connections());
  registry_.counter(metrics::kMessagesMalformed);
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    registry_.counter(metrics::kMessagesRefused, {proto::ToString(code)});
  }
}

void PolicyServer::Publish(policy::PolicySnapshot acting, ShippedPolicy shipped,
                           std::int64_t steps) {
  steps_ = steps;
  published_ns_ = std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count();
  acting_ = std::move(acting);
  shipped_ = std::move(shipped);
  messages_ = {};
  registry_.counter(metrics::kPoliciesPublished).Increment();
  registry_.gauge(metrics::kPolicyVersion).Set(static_cast<double>(acting_->version));
  registry_.gauge(metrics::kPolicyTimestamp).Set(1e-9 * static_cast<double>(published_ns_));
  for (auto it = readers_.begin(); it != readers_.end();) {
    const auto next = std::next(it);
    if (it->second.waits) Send(it->first, it->second, *NewestFor(it->second));
    it = next;
  }
}

PolicyServer::Message PolicyServer::MakeMessage(Kind kind) {
  const nn::Metadata of_run = {{proto::kIdentityMetadata, run_}};
  const PolicyFile file =
      kind == kShipped
          ? shipped_(of_run)
          : PolicyFile{acting_->version,
                       policy::PrintPolicy(
                           kind == kActing ? *acting_ : policy::WithoutPlanning(*acting_), of_run)};
  transport::Frame payload = transport::Frame::Copy(file.bytes);
  registry_.gauge(metrics::kPolicyBytes).Set(static_cast<double>(payload.size()));
  proto::Snapshot snapshot;
  snapshot.version = file.version;
  snapshot.spec_hash = spec_hash_;
  snapshot.published_ns = published_ns_;
  snapshot.learner_steps = steps_;
  transport::Frame header = transport::Frame::Copy(proto::Encode(snapshot, payload.bytes()));
  return {file.version, std::move(header), std::move(payload)};
}

const PolicyServer::Message* PolicyServer::NewestFor(const Reader& reader) {
  if (!acting_) return nullptr;
  const bool is_same = reader.kind == kWithoutModel && !acting_->spec.planning.is_carried();
  const Kind kind = is_same ? kActing : reader.kind;
  std::optional<Message>& message = messages_[kind];
  if (!message) message = MakeMessage(kind);
  return &*message;
}

void PolicyServer::Poll(milliseconds timeout) {
  registry_.Beat();
  for (int i = 0; i < kMaxAtOnce; ++i) {
    auto received = server_.Receive(i == 0 ? timeout : milliseconds(0));
    if (!received) break;
    Answer(*received);
  }
  ForgetSilentReaders();
}

void PolicyServer::Answer(transport::Server::Received& received) {
  if (received.no_room) {
    const proto::Refusal refusal = proto::NoRoom(server_.max_connections());
    return Refuse(received.peer, refusal.code, refusal.text);
  }
  if (received.too_fast) {
    return Refuse(received.peer, proto::RefusalCode::kTooFast, "too many messages a second");
  }
  const auto header =
      proto::Decode(received.message.header.bytes(), received.message.payload.bytes());
  if (!header) return Refuse(received.peer, header.failure().code, header.failure().text);
  registry_.counter(metrics::kMessages, {proto::NameOf(*header)}).Increment();
  const auto* request = std::get_if<proto::SnapshotRequest>(&*header);
  if (request == nullptr || !MayRead(received.role)) {
    return Refuse(received.peer, proto::RefusalCode::kNotAllowed,
                  "the learner only answers requests for policies from actors and evaluators");
  }
  const auto [it, is_new] = readers_.try_emplace(received.peer);
  if (is_new && readers_.size() > kMaxReaders) {
    readers_.erase(it);
    return Refuse(received.peer, proto::RefusalCode::kNotReady, "too many readers");
  }
  Reader& reader = it->second;
  reader.heard_at = steady_clock::now();
  reader.held_version = request->held_version;
  reader.kind = request->shipped ? kShipped : request->without_model ? kWithoutModel : kActing;
  const Message* const newest = NewestFor(reader);
  if (newest != nullptr && newest->version != request->held_version) {
    return Send(received.peer, reader, *newest);
  }
  if (!reader.waits) {
    reader.waits = true;
    return;
  }
  // Asked again: answers without a payload, to show that the learner is alive.
  proto::Snapshot nothing;
  nothing.version = request->held_version;
  nothing.spec_hash = spec_hash_;
  reader.waits = false;
  static_cast<void>(
      server_.Send(received.peer, {transport::Frame::Copy(proto::Encode(nothing, {})), {}}));
}

void PolicyServer::Send(const transport::PeerId& peer, Reader& reader, const Message& message) {
  reader.waits = false;
  // A reader that does not read now asks again later.
  const auto sent = server_.Send(peer, {message.header.Share(), message.payload.Share()});
  if (sent == transport::Server::Sent::kGone) readers_.erase(transport::PeerId(peer));
}

void PolicyServer::Refuse(const transport::PeerId& peer, proto::RefusalCode code,
                          std::string text) {
  registry_.counter(metrics::kMessagesRefused, {proto::ToString(code)}).Increment();
  refusal_log_.Note("learner", "a reader of policies", code, text, steady_clock::now());
  const proto::Refusal refusal{code, std::move(text), 0};
  static_cast<void>(server_.Send(peer, {transport::Frame::Copy(proto::Encode(refusal, {})), {}}));
}

void PolicyServer::ForgetSilentReaders() {
  const auto now = steady_clock::now();
  if (looked_at_ && now - *looked_at_ < std::chrono::seconds(1)) return;
  looked_at_ = now;
  std::erase_if(readers_,
                [&](const auto& reader) { return now - reader.second.heard_at > kSilence; });
  const transport::Server::Connections connections = server_.connections();
  registry_.counter(metrics::kRejectedConnections)
      .RaiseTo(static_cast<double>(connections.rejected));
  registry_.gauge(metrics::kServerConnections).Set(connections.open);
  for (const auto& [reason, count] : connections.ended) {
    registry_.counter(metrics::kConnectionsEnded, {transport::ToString(reason)})
        .RaiseTo(static_cast<double>(count));
  }
  registry_.counter(metrics::kMessagesMalformed).RaiseTo(static_cast<double>(server_.malformed()));
  registry_.gauge(metrics::kConnectedPeers, {"reader"}).Set(num_readers());
  if (const auto oldest = oldest_held(); oldest && acting_) {
    registry_.gauge(metrics::kReaderLag)
        .Set(static_cast<double>(std::max<std::int64_t>(acting_->version - *oldest, 0)));
  }
}

std::optional<std::int64_t> PolicyServer::oldest_held() const {
  std::optional<std::int64_t> oldest;
  for (const auto& [peer, reader] : readers_) {
    oldest = std::min(oldest.value_or(reader.held_version), reader.held_version);
  }
  return oldest;
}

}  // namespace slalom::learner
