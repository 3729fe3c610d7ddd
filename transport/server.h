#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "transport/context.h"
#include "transport/event_fd.h"
#include "transport/frame.h"
#include "transport/monitor.h"
#include "transport/peers.h"
#include "transport/security.h"

namespace slalom::transport {

struct ServerOptions {
  /// "tcp://127.0.0.1:5550", "tcp://*:5550" for all addresses, port 0 or * for any free one;
  /// "ipc://PATH"; "inproc://NAME".
  std::string endpoint;
  ServerSecurity security = {};               ///< Not for inproc.
  std::int64_t max_message_bytes = 64 << 20;  ///< Larger parts end their connection.
  double max_messages_per_second = 20000.0;   ///< Of one peer, over a second or so.
  int queue_messages = 256;                   ///< To be sent, per peer.
  std::int64_t max_pending_bytes = 256
                                   << 20;  ///< Received of one peer, and not taken yet; more
                                           ///< (or of all peers four times that) ends its
                                           ///< connection. Beyond what a peer may have under way.
  int max_connections = 512;               ///< More are ended at once.
  std::chrono::milliseconds heartbeat{
      2000};  ///< Of silent connections; gone after three. At most half an hour.
};

/// The listening end: takes messages of many peers and answers any of them at any time (ROUTER).
///
/// Never waits for a peer and never holds more for it than the bounds below say. A peer that
/// connects again is another peer. Rates, pending bytes and the number of connections are bounded
/// over tcp (rates and connections over ipc, too), not for peers in this process. The bounds are
/// looked after in `Receive`, so call it several times a second. Confined to the thread that made
/// it, but for `Wake`.
class Server {
 public:
  /// Throws `base::Error` where the endpoint cannot be bound, with the reason.
  Server(Context& context, const ServerOptions& options);
  /// Ends all connections. The port is free again afterwards.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  struct Received {
    PeerId peer;
    /// By the peer's key; none: plaintext, where it may be what it says.
    std::optional<Role> role;
    Message message;
    bool too_fast = false;  ///< The peer is over its rate: refuse, without a look at the message.
  };

  /// The next message, after at most `timeout`. None: none came, or `Wake` was called, or a signal
  /// came. Messages that have not two parts are counted (`malformed`) and passed over.
  std::optional<Received> Receive(std::chrono::milliseconds timeout);

  enum class Sent {
    kYes,
    kFull,  ///< The peer does not read; try later or give it up.
    kGone,  ///< The connection is no more. A full one shows this only after a `Receive`.
  };
  /// Takes the message only where it is sent. Never waits.
  [[nodiscard]] Sent Send(const PeerId& peer, Message&& message);

  /// Ends a `Receive` that waits, or the next one that would. Any thread, and in signal handlers.
  void Wake() { wake_.Set(); }

  /// Where it listens, with the port that was chosen.
  const std::string& endpoint() const { return endpoint_; }
  std::int64_t malformed() const { return malformed_; }
  /// Connections whose handshake failed: wrong keys, no keys, not ZeroMQ.
  std::int64_t rejected_connections();
  /// Connections that were ended for being over a bound of `ServerOptions`.
  std::int64_t ended_connections();

 private:
  enum class Taken { kMessage, kMalformed, kNone };
  Taken Take(std::optional<Received>& received);
  void WaitUntilFree();

  Context& context_;
  const ServerOptions options_;
  const std::string domain_;  // Of authentication; empty: inproc.
  zmq::socket_t socket_;
  Monitor monitor_;
  Peers peers_;
  EventFd wake_;
  std::string endpoint_;
  std::int64_t malformed_ = 0;
};

}  // namespace slalom::transport
