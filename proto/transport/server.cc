#include "proto/transport/server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <string_view>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/log.h"
#include "base/machine.h"
#include "proto/transport/endpoint.h"

namespace slalom::transport {
namespace {

constexpr std::size_t kSmall = 1024;

/// A part on its way: ZeroMQ reads its bytes, and destroys this once it needs them no more.
struct Underway {
  zmq::message_t part;
  std::shared_ptr<std::atomic<std::int64_t>> counter;
};

void Sent(void*, void* underway) {
  const std::unique_ptr<Underway> sent(static_cast<Underway*>(underway));
  sent->counter->fetch_sub(static_cast<std::int64_t>(sent->part.size()));
}

}  // namespace

std::int64_t QueuedBytes::Counted(const zmq::message_t& part) {
  return part.size() > kSmall ? static_cast<std::int64_t>(part.size()) : 0;
}

std::int64_t QueuedBytes::Of(const PeerId& peer) const {
  const auto found = peers_.find(peer);
  return found == peers_.end() ? 0 : found->second->load();
}

void QueuedBytes::Count(const PeerId& peer, zmq::message_t& part) {
  const std::int64_t size = Counted(part);
  if (size == 0) return;
  if (peers_.size() >= sweep_at_) {
    std::erase_if(peers_, [](const auto& entry) { return entry.second->load() == 0; });
    sweep_at_ = std::max<std::size_t>(64, 2 * peers_.size());
  }
  std::shared_ptr<Counter>& counter = peers_[peer];
  if (!counter) counter = std::make_shared<Counter>(0);
  counter->fetch_add(size);
  auto underway = std::make_unique<Underway>();
  underway->part.swap(part);
  underway->counter = counter;
  void* const bytes = underway->part.data();
  part.rebuild(bytes, static_cast<std::size_t>(size), Sent, underway.release());
}

namespace {

using std::chrono::milliseconds;
using Clock = Peers::Clock;

constexpr milliseconds kCloseTimeout{1000};
constexpr std::int64_t kTotalOverPeer = 4;
constexpr int kOperators = 8;

constexpr int kReservedDescriptors = 256;
constexpr int kFewestDescriptors = 320;
/// Handshakes that may be under way at once, as multiples of `max_handshakes`.
constexpr int kYoungHandshakes = 16;
/// Time between two looks at who has come. ZeroMQ takes every connection meanwhile.
constexpr milliseconds kWatchInterval{10};

milliseconds HandshakeTime(milliseconds heartbeat) { return 5 * heartbeat; }

Places PlacesOf(const ServerOptions& options) {
  if (IsInproc(options.endpoint)) return {.connections = options.max_connections};
  const int descriptors = base::DescriptorLimit();
  const Places places = PlacesWithin(descriptors, options);
  if (places.connections < options.max_connections) {
    spdlog::warn(
        "{}: takes {} connections at most, fewer than service.max_connections ({}), because this "
        "process may open {} files and connections; raise that limit (`ulimit -Hn`, LimitNOFILE=)",
        options.endpoint, places.connections, options.max_connections, descriptors);
  }
  return places;
}

Peers::Limits LimitsOf(const ServerOptions& options) {
  const Places places = PlacesOf(options);
  return {.messages_per_second = options.max_messages_per_second,
          .connection_bytes = options.max_pending_bytes,
          .total_bytes = kTotalOverPeer * options.max_pending_bytes,
          .connections = places.connections,
          .operators = kOperators,
          .handshakes = places.handshakes,
          .newcomers = places.newcomers,
          .handshake = HandshakeTime(options.heartbeat)};
}

/// As `Context::Authenticate` says it: a role, and the names that it may have.
std::string_view UserOf(zmq::message_t& part) {
  const char* user = zmq_msg_gets(part.handle(), "User-Id");
  return user == nullptr ? "" : user;
}

}  // namespace

Places PlacesWithin(int descriptors, const ServerOptions& options) {
  base::ThrowIf(
      descriptors < kFewestDescriptors,
      "{}: cannot listen: found a limit of {} files and connections for this process; expected "
      "{} at least (`ulimit -Hn`, LimitNOFILE=)",
      options.endpoint, descriptors, kFewestDescriptors);
  const int shared = descriptors - kReservedDescriptors - kOperators;
  Places places;
  places.connections = std::min(options.max_connections, shared / 2);
  places.newcomers =
      std::min(kYoungHandshakes * options.max_handshakes, (shared - places.connections) / 3);
  places.handshakes = std::min(options.max_handshakes, places.newcomers / 2);
  return places;
}

Server::Server(Context& context, const ServerOptions& options)
    : context_(context),
      options_(options),
      domain_(IsInproc(options.endpoint) ? "" : context.NewName("server")),
      limits_(LimitsOf(options)),
      socket_(context.zmq(), zmq::socket_type::router),
      monitor_(context, socket_, Peers::kEvents | ZMQ_EVENT_CLOSED),
      peers_(monitor_, limits_) {
  CheckEndpoint(options.endpoint);
  const int heartbeat = static_cast<int>(options.heartbeat.count());
  socket_.set(zmq::sockopt::linger, 0);
  socket_.set(zmq::sockopt::router_mandatory, true);
  socket_.set(zmq::sockopt::sndhwm, options.queue_messages);
  // The number of messages is not bounded, since bytes are (`max_pending_bytes`). If ZeroMQ 4.3
  // stops reading at such a bound and the connection then breaks, its next heartbeat aborts the
  // process.
  socket_.set(zmq::sockopt::rcvhwm, domain_.empty() ? options.queue_messages : 0);
  socket_.set(zmq::sockopt::maxmsgsize, options.max_message_bytes);
  socket_.set(zmq::sockopt::heartbeat_ivl, heartbeat);
  socket_.set(zmq::sockopt::heartbeat_timeout, 3 * heartbeat);
  socket_.set(zmq::sockopt::heartbeat_ttl, 3 * heartbeat);
  socket_.set(zmq::sockopt::handshake_ivl,
              static_cast<int>(HandshakeTime(options.heartbeat).count()));
  socket_.set(zmq::sockopt::ipv6, IsIpv6(options.endpoint));
  if (!domain_.empty()) {
    // For plaintext, too, because ZeroMQ then does not take arbitrary bytes for its oldest
    // protocol.
    socket_.set(zmq::sockopt::zap_domain, domain_);
    watcher_ = base::StartThread("watching connections",
                                 [this](const std::stop_token& stop) { Watch(stop); });
    if (options.security.keys) {
      socket_.set(zmq::sockopt::curve_server, true);
      socket_.set(zmq::sockopt::curve_secretkey, options.security.keys->secret_key);
      context_.Authenticate(domain_, options.security.allowed);
    } else {
      context_.Authenticate(domain_, std::nullopt);
    }
  }
  if (zmq_bind(socket_.handle(), options.endpoint.c_str()) != 0) {
    const int error = zmq_errno();
    context_.Forget(domain_);
    throw base::Error(
        "{}: cannot listen ({}); expected tcp://ADDRESS:PORT with an address of this machine and a "
        "free port",
        options.endpoint, zmq_strerror(error));
  }
  endpoint_ = socket_.get(zmq::sockopt::last_endpoint);
}

Server::~Server() {
  watcher_ = {};  // From here on this thread alone uses the monitor.
  if (IsTcp(endpoint_)) WaitUntilFree();
  if (!domain_.empty()) context_.Forget(domain_);
}

void Server::Watch(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  const auto is_over = [&stop] { return stop.stop_requested(); };
  while (!stopped.wait_for(lock, stop, kWatchInterval, is_over)) peers_.Update(Clock::now());
}

// ZeroMQ closes the port in its own thread some time later, so this waits for it.
void Server::WaitUntilFree() {
  if (zmq_unbind(socket_.handle(), endpoint_.c_str()) != 0) return;
  const auto deadline = Clock::now() + kCloseTimeout;
  zmq::pollitem_t item{monitor_.handle(), 0, ZMQ_POLLIN, 0};
  while (Clock::now() < deadline) {
    zmq_poll(&item, 1, kCloseTimeout.count());
    while (const auto event = monitor_.Next()) {
      if (event->type == ZMQ_EVENT_CLOSED) return;
    }
  }
}

std::optional<Server::Received> Server::Receive(milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  std::array<zmq::pollitem_t, 2> items{
      {{socket_.handle(), 0, ZMQ_POLLIN, 0}, {nullptr, wake_.fd(), ZMQ_POLLIN, 0}}};
  for (;;) {
    std::optional<Received> received;
    const Taken taken = Take(received);
    if (taken == Taken::kMessage) return received;
    const auto remaining = std::chrono::ceil<milliseconds>(deadline - Clock::now());
    if (taken == Taken::kNone) {
      const auto wait = std::max(remaining, milliseconds(0));
      if (zmq_poll(items.data(), static_cast<int>(items.size()), wait.count()) < 0) {
        return std::nullopt;
      }
      if (items[1].revents != 0) {
        wake_.Clear();
        return std::nullopt;
      }
      if (items[0].revents != 0) continue;
    }
    if (remaining <= milliseconds(0)) return std::nullopt;
  }
}

Server::Taken Server::Take(std::optional<Received>& received) {
  std::array<zmq::message_t, 3> parts;  // Id, header, payload.
  std::size_t num_parts = 0;
  std::int64_t bytes = 0;
  for (bool more = true; more; ++num_parts) {
    zmq::message_t beyond;
    zmq::message_t& part = num_parts < parts.size() ? parts[num_parts] : beyond;
    if (zmq_msg_recv(part.handle(), socket_.handle(), ZMQ_DONTWAIT) < 0) break;
    if (num_parts > 0) bytes += static_cast<std::int64_t>(part.size());
    more = part.more();
  }
  if (num_parts == 0) return Taken::kNone;
  const auto now = Clock::now();
  PeerId peer = parts[0].to_string();
  const int fd = zmq_msg_get(parts[1].handle(), ZMQ_SRCFD);
  const std::string_view user = UserOf(parts[1]);
  const std::optional<Role> role = ParseRole(user.substr(0, user.find(' ')));
  const auto admission = peers_.Admit(peer, fd, bytes, role == Role::kOperator, now);
  if (num_parts != parts.size()) {
    ++malformed_;
    return Taken::kMalformed;
  }
  received.emplace();
  received->peer = std::move(peer);
  received->role = role;
  if (const auto space = user.find(' '); space != std::string_view::npos) {
    received->names = user.substr(space + 1);
  }
  received->message.header = Frame(std::move(parts[1]));
  received->message.payload = Frame(std::move(parts[2]));
  received->too_fast = admission == Peers::Admission::kTooFast;
  received->no_room = admission == Peers::Admission::kNoRoom;
  return Taken::kMessage;
}

Server::Sent Server::Send(const PeerId& peer, Message&& message, std::int64_t max_queued_bytes) {
  const bool is_inproc = domain_.empty();  // Its parts are in use for as long as the peer has them.
  const std::int64_t size = QueuedBytes::Counted(message.header.message_) +
                            QueuedBytes::Counted(message.payload.message_);
  if (const std::int64_t queued = size > 0 && !is_inproc ? queued_.Of(peer) : 0;
      queued > 0 && queued + size > max_queued_bytes) {
    return Sent::kFull;
  }
  // Only the first part can be refused. Once it is accepted, the connection is chosen and has room.
  if (zmq_send(socket_.handle(), peer.data(), peer.size(), ZMQ_SNDMORE | ZMQ_DONTWAIT) < 0) {
    return zmq_errno() == EAGAIN ? Sent::kFull : Sent::kGone;
  }
  if (!is_inproc) {
    queued_.Count(peer, message.header.message_);
    queued_.Count(peer, message.payload.message_);
  }
  const int header = zmq_msg_send(message.header.message_.handle(), socket_.handle(), ZMQ_SNDMORE);
  const int payload = zmq_msg_send(message.payload.message_.handle(), socket_.handle(), 0);
  SLALOM_CHECK(header >= 0 && payload >= 0);
  return Sent::kYes;
}

Server::Connections Server::connections() {
  peers_.Update(Clock::now());
  const Peers::Counts counts = peers_.counts();
  Connections connections{
      .rejected = counts.rejected, .ended = {}, .open = counts.open, .limit = limits_.connections};
  for (const EndReason reason : kEndReasons) {
    connections.ended[reason] = counts.ended[static_cast<std::size_t>(reason)];
  }
  return connections;
}

}  // namespace slalom::transport
