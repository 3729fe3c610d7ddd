#include "proto/transport/client.h"

#include <algorithm>
#include <array>
#include <random>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/log.h"
#include "proto/transport/endpoint.h"

namespace slalom::transport {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kReconnect{100};
constexpr milliseconds kReconnectMax{1000};
constexpr milliseconds kConnectTimeout{3000};
/// So long that ZeroMQ never connects again by itself.
constexpr std::chrono::hours kNeverReconnect{24};

constexpr int kEvents = ZMQ_EVENT_CONNECT_RETRIED | ZMQ_EVENT_CLOSED | ZMQ_EVENT_DISCONNECTED |
                        ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                        ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH;

/// So that many clients of a server that restarts do not all come at once.
milliseconds Jitter() { return milliseconds(std::random_device()() % kReconnect.count()); }

constexpr char kNobody[] = "nobody listens there";
constexpr char kBroke[] = "the connection broke";
constexpr char kSilent[] =
    "the handshake failed: the other side has other keys, has too many connections, or is not a "
    "server of Slalom";
constexpr char kRefused[] = "our key is not on the server's allow list";

}  // namespace

Client::Client(Context& context, const ClientOptions& options)
    : context_(context), options_(options), pause_(kReconnect) {
  CheckEndpoint(options.endpoint);
  Open();
}

void Client::Open() {
  monitor_.reset();
  socket_ = zmq::socket_t(context_.zmq(), zmq::socket_type::dealer);
  monitor_.emplace(context_, socket_, kEvents);
  const bool is_inproc = IsInproc(options_.endpoint);
  const int heartbeat = static_cast<int>(options_.heartbeat.count());
  socket_.set(zmq::sockopt::linger, 0);
  socket_.set(zmq::sockopt::sndhwm, options_.queue_messages);
  // As `Server`: a heartbeat must not find reading stopped.
  socket_.set(zmq::sockopt::rcvhwm, is_inproc ? options_.queue_messages : 0);
  socket_.set(zmq::sockopt::maxmsgsize, options_.max_message_bytes);
  socket_.set(zmq::sockopt::heartbeat_ivl, heartbeat);
  socket_.set(zmq::sockopt::heartbeat_timeout, 3 * heartbeat);
  socket_.set(zmq::sockopt::heartbeat_ttl, 3 * heartbeat);
  socket_.set(zmq::sockopt::handshake_ivl, 5 * heartbeat);
  socket_.set(zmq::sockopt::reconnect_ivl, static_cast<int>(milliseconds(kNeverReconnect).count()));
  socket_.set(zmq::sockopt::connect_timeout, static_cast<int>(kConnectTimeout.count()));
  socket_.set(zmq::sockopt::ipv6, IsIpv6(options_.endpoint));
  if (options_.security.keys && !is_inproc) {
    socket_.set(zmq::sockopt::curve_publickey, options_.security.keys->public_key);
    socket_.set(zmq::sockopt::curve_secretkey, options_.security.keys->secret_key);
    socket_.set(zmq::sockopt::curve_serverkey, options_.security.server_key);
  }
  if (zmq_connect(socket_.handle(), options_.endpoint.c_str()) != 0) {
    throw base::Error("{}: cannot connect ({}); expected tcp://HOST:PORT", options_.endpoint,
                      zmq_strerror(zmq_errno()));
  }
  retry_at_.reset();
  connected_ = is_inproc;
  connections_ += is_inproc ? 1 : 0;
  trouble_ = is_inproc ? "" : "not connected yet";
}

void Client::Reconnect() { Open(); }

// Each attempt has a socket of its own. A socket that connects again by itself either sends what
// was queued for the connection before (ZMQ_IMMEDIATE off), or aborts the process if the connection
// breaks while a message is half read (on; libzmq 4.3.4, "Assertion failed: !_more").
void Client::Update() {
  while (const auto event = monitor_->Next()) {
    switch (event->type) {
      case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
        ++connections_;
        connected_ = true;
        trouble_.clear();
        warned_.clear();
        pause_ = kReconnect;
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
        Warn(kRefused);
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
      case ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL:
        Warn(kSilent);
        break;
      case ZMQ_EVENT_CLOSED:
        trouble_ = kNobody;
        break;
      case ZMQ_EVENT_DISCONNECTED:
        if (connected_) trouble_ = kBroke;
        connected_ = false;
        [[fallthrough]];
      default:  // Trying again, or so ZeroMQ says.
        if (!retry_at_) retry_at_ = Clock::now() + pause_ + Jitter();
    }
  }
  if (retry_at_ && Clock::now() >= *retry_at_) {
    pause_ = std::min(2 * pause_, kReconnectMax);
    const std::string trouble = trouble_;
    Open();
    trouble_ = trouble;
  }
}

/// Warns of trouble that does not go away by waiting, once until it is resolved.
void Client::Warn(const char* trouble) {
  trouble_ = trouble;
  if (warned_ == trouble) return;
  warned_ = trouble;
  spdlog::warn("{}: {}; trying again", options_.endpoint, trouble);
}

bool Client::Send(Message&& message) {
  Update();
  // ZeroMQ accepts messages a moment before it reports that it is connected.
  if (!connected_) return false;
  // Only the first part can be refused. If the connection breaks between the parts, ZeroMQ drops
  // both of them, and the message is lost.
  const int flags = ZMQ_SNDMORE | ZMQ_DONTWAIT;
  if (zmq_msg_send(message.header.message_.handle(), socket_.handle(), flags) < 0) return false;
  const int sent = zmq_msg_send(message.payload.message_.handle(), socket_.handle(), 0);
  SLALOM_CHECK(sent >= 0);
  return true;
}

std::optional<Message> Client::Receive(milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  for (;;) {
    Update();
    std::array<zmq::message_t, 2> parts;
    std::size_t num_parts = 0;
    for (bool more = true; more; ++num_parts) {
      zmq::message_t beyond;
      zmq::message_t& part = num_parts < parts.size() ? parts[num_parts] : beyond;
      if (zmq_msg_recv(part.handle(), socket_.handle(), ZMQ_DONTWAIT) < 0) break;
      more = part.more();
    }
    if (num_parts == parts.size()) {
      return Message{Frame(std::move(parts[0])), Frame(std::move(parts[1]))};
    }
    const auto remaining = std::chrono::ceil<milliseconds>(deadline - Clock::now());
    if (remaining <= milliseconds(0)) return std::nullopt;
    if (num_parts > 0) continue;
    std::array<zmq::pollitem_t, 2> items{
        {{socket_.handle(), 0, ZMQ_POLLIN, 0}, {monitor_->handle(), 0, ZMQ_POLLIN, 0}}};
    milliseconds wait = remaining;
    if (retry_at_) {
      const auto until_retry = std::chrono::ceil<milliseconds>(*retry_at_ - Clock::now());
      wait = std::clamp(until_retry, milliseconds(0), remaining);
    }
    if (zmq_poll(items.data(), static_cast<int>(items.size()), wait.count()) < 0) {
      return std::nullopt;
    }
  }
}

int Client::connections() {
  Update();
  return connections_;
}

bool Client::connected() {
  Update();
  return connected_;
}

std::string Client::trouble() {
  Update();
  return trouble_;
}

void Client::WaitForAny(std::span<Client* const> clients, milliseconds timeout) {
  std::vector<zmq::pollitem_t> items;
  for (Client* client : clients) {
    client->Update();
    items.push_back({client->socket_.handle(), 0, ZMQ_POLLIN, 0});
  }
  zmq_poll(items.data(), static_cast<int>(items.size()), timeout.count());
}

}  // namespace slalom::transport
