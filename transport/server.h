#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "transport/context.h"
#include "transport/frame.h"
#include "transport/security.h"

namespace slalom::transport {

struct ServerOptions {
  std::string endpoint;  ///< "tcp://127.0.0.1:5550", port 0 or * for any free one; "inproc://NAME".
  ServerSecurity security;
  std::int64_t max_message_bytes = 64 << 20;  ///< Larger parts end their connection.
  double max_messages_per_second = 20000.0;   ///< Of one peer, over a second or so.
  int queue_messages = 256;                   ///< Per peer and direction.
  std::chrono::milliseconds heartbeat{2000};  ///< Of silent connections; gone after three.
};

/// A connection, for as long as it stands.
using PeerId = std::string;

/// The listening end: takes messages of many peers and answers any of them at any time (ROUTER).
///
/// Never waits for a peer and never holds more for it than its queue. Confined to the thread that
/// made it, but for `Wake`.
class Server {
 public:
  /// Throws `base::Error` where the endpoint cannot be bound, with the reason.
  Server(Context& context, const ServerOptions& options);
  ~Server();

  struct Received {
    PeerId peer;
    /// By the peer's key; none: plaintext, where it may be what it says.
    std::optional<Role> role;
    Message message;
    bool too_fast = false;  ///< The peer is over its rate: refuse, without a look at the message.
  };

  /// The next message, after at most `timeout`. None: none came, or `Wake` was called. Messages
  /// that have not two parts are counted (`malformed`) and passed over.
  std::optional<Received> Receive(std::chrono::milliseconds timeout);

  enum class Sent {
    kYes,
    kFull,  ///< The peer does not read; try later or give it up.
    kGone,  ///< The connection is no more.
  };
  /// Takes the message only where it is sent.
  [[nodiscard]] Sent Send(const PeerId& peer, Message&& message);

  /// Ends a `Receive` that waits, or the next one. Any thread.
  void Wake();

  /// Where it listens, with the port that was chosen.
  const std::string& endpoint() const { return endpoint_; }
  std::int64_t malformed() const { return malformed_; }
  /// Handshakes that failed: wrong keys, no keys, not ZeroMQ.
  std::int64_t rejected_connections();

 private:
  struct Bucket {
    double tokens = 0.0;
    std::chrono::steady_clock::time_point filled;
  };

  const ServerOptions options_;
  std::string endpoint_;
  zmq::socket_t socket_;
  zmq::socket_t wake_;     // Read end.
  zmq::socket_t monitor_;  // Of failed handshakes.
  int wake_fd_ = -1;
  std::map<PeerId, Bucket> buckets_;
  std::int64_t malformed_ = 0;
  std::int64_t rejected_ = 0;
};

}  // namespace slalom::transport
