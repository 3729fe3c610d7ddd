#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>
#include <zmq.hpp>

#include "proto/transport/context.h"
#include "proto/transport/event_fd.h"
#include "proto/transport/frame.h"
#include "proto/transport/monitor.h"
#include "proto/transport/peers.h"
#include "proto/transport/security.h"

namespace slalom::transport {

/// Counts the bytes that wait to be sent to each peer, which ZeroMQ does not tell. Small parts do
/// not count: the number of messages bounds them. Confined to one thread; ZeroMQ's threads may send
/// meanwhile, and after the object is gone.
class QueuedBytes {
 public:
  /// Size of a part if it counts, else 0.
  static std::int64_t Counted(const zmq::message_t& part);

  /// Bytes of the peer's parts that were counted and are not sent or dropped yet.
  std::int64_t Of(const PeerId& peer) const;

  /// Makes a part count for the peer until ZeroMQ has sent or dropped it. Copies no byte. Does
  /// nothing with a small part.
  void Count(const PeerId& peer, zmq::message_t& part);

 private:
  using Counter = std::atomic<std::int64_t>;

  std::unordered_map<PeerId, std::shared_ptr<Counter>> peers_;
  std::size_t sweep_at_ = 64;  ///< Number of peers at which those without bytes are forgotten.
};

struct ServerOptions {
  /// "tcp://127.0.0.1:5550", "tcp://*:5550" for all addresses, port 0 or * for any free one;
  /// "ipc://PATH"; "inproc://NAME".
  std::string endpoint;
  ServerSecurity security = {};               ///< Not used over inproc.
  std::int64_t max_message_bytes = 64 << 20;  ///< A larger part ends its connection.
  double max_messages_per_second = 20000.0;   ///< Rate of one peer, over about a second.
  int queue_messages = 256;                   ///< Messages that may wait to be sent to a peer.
  /// Bytes that may wait to be sent to a peer. While some wait, a message that would exceed this is
  /// refused as if the queue were full. Parts of up to 1 KiB do not count. Not bounded over inproc.
  std::int64_t max_queued_bytes = 64 << 20;
  /// Bytes received from one peer and not taken yet. A connection that exceeds this is ended. While
  /// all connections together exceed four times this, the one with most is ended. Must be larger
  /// than the bytes that an honest peer may have under way.
  std::int64_t max_pending_bytes = 256 << 20;
  /// Connections that have sent a message. The next one is told so (`Received::no_room`) and ends.
  /// Eight more are kept for peers with an operator's key.
  int max_connections = 4096;
  /// Connections that have not sent a message yet. If there are more, the oldest end.
  int max_handshakes = 256;
  /// Interval of heartbeats on a silent connection, at most half an hour. After three without an
  /// answer the connection counts as lost.
  std::chrono::milliseconds heartbeat{2000};
};

/// The listening end (a ZeroMQ ROUTER socket): takes messages from many peers and can answer any of
/// them at any time.
///
/// It never waits for a peer and never holds more for it than the bounds in `ServerOptions` allow.
/// A peer that connects again counts as a new peer. Over tcp, rates, pending bytes and the number
/// of connections are bounded; over ipc, rates and connections; within this process, none of them.
/// A thread of its own enforces the bounds, however long the caller is busy with other things.
///
/// The numbers of connections are bounded by the descriptors that the process may have, too, of
/// which some are kept for files (`PlacesWithin`). So a process has one server that others reach.
/// Confined to the thread that made it, except for `Wake`.
class Server {
 public:
  /// Warns if the process has too few descriptors for `max_connections`. Throws `base::Error` with
  /// the reason if the endpoint cannot be bound, or if there are not even descriptors for files.
  Server(Context& context, const ServerOptions& options);
  /// Ends all connections. The port is free again afterwards.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  struct Received {
    PeerId peer;
    /// The role that belongs to the peer's key. Empty for plaintext: any claimed role must then be
    /// believed.
    std::optional<Role> role;
    std::string names;  ///< The names that the key's holder may have (`AllowsName`).
    Message message;
    bool too_fast = false;  ///< The peer is over its rate. Refuse the message unread.
    bool no_room = false;   ///< The peer's connection ends in a moment. Refuse the message unread.
  };

  /// Waits for at most `timeout` and returns the next message, or nothing if none arrived, `Wake`
  /// was called or a signal interrupted the wait. Messages that do not have two parts are counted
  /// (`malformed`) and dropped.
  std::optional<Received> Receive(std::chrono::milliseconds timeout);

  enum class Sent {
    kYes,
    kFull,  ///< The peer does not read, or not fast enough. Try later, or give it up.
    kGone,  ///< The connection is closed. After kFull this shows only after a `Receive`.
  };
  /// Sends a message without waiting. Takes it over only if it is sent.
  [[nodiscard]] Sent Send(const PeerId& peer, Message&& message) {
    return Send(peer, std::move(message), options_.max_queued_bytes);
  }
  /// The same with another bound than `ServerOptions::max_queued_bytes`.
  [[nodiscard]] Sent Send(const PeerId& peer, Message&& message, std::int64_t max_queued_bytes);

  /// Ends a `Receive` that waits, or the next one that would wait. May be called from any thread
  /// and in signal handlers.
  void Wake() { wake_.Set(); }

  /// The endpoint on which it listens, with the actual port.
  const std::string& endpoint() const { return endpoint_; }
  std::int64_t malformed() const { return malformed_; }
  /// What became of the connections so far.
  struct Connections {
    std::int64_t rejected = 0;                ///< Handshakes failed: wrong keys, not ZeroMQ.
    std::map<EndReason, std::int64_t> ended;  ///< They exceeded a bound of `ServerOptions`.
    int open = 0;                             ///< Now.
    int limit = 0;                            ///< `Server::max_connections`.
  };
  Connections connections();
  /// `ServerOptions::max_connections`, or what the descriptors of the process leave of them.
  int max_connections() const { return limits_.connections; }

 private:
  enum class Taken { kMessage, kMalformed, kNone };
  Taken Take(std::optional<Received>& received);
  void Watch(const std::stop_token& stop);
  void WaitUntilFree();

  Context& context_;
  const ServerOptions options_;
  const std::string domain_;  // Authentication domain; empty for inproc.
  const Peers::Limits limits_;
  zmq::socket_t socket_;
  Monitor monitor_;
  Peers peers_;
  QueuedBytes queued_;
  EventFd wake_;
  std::string endpoint_;
  std::int64_t malformed_ = 0;
  std::jthread watcher_;  // Keeps `peers_` within their limits. Not within the process.
};

/// How many connections of each kind a server has room for.
struct Places {
  int connections = 0;  ///< At most `ServerOptions::max_connections`.
  int handshakes = 0;   ///< At most `ServerOptions::max_handshakes`.
  int newcomers = 0;    ///< Those that are too young to be ended, handshakes included.
};
/// Shares out the descriptors of a process that may have so many. Keeps 256 for files and HTTP,
/// eight for operators, and some for connections that come between two looks. Throws `base::Error`
/// if there are fewer than 320.
Places PlacesWithin(int descriptors, const ServerOptions& options);

}  // namespace slalom::transport
