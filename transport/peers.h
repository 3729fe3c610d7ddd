#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

#include "transport/monitor.h"

namespace slalom::transport {

/// A connection, for as long as it stands.
using PeerId = std::string;

/// The connections of a server and what each of them may use of it.
///
/// ZeroMQ bounds the parts of a message and the number of whole messages that wait, but neither the
/// number of parts, nor the bytes of a message that is not whole yet. So what the kernel has
/// received on a connection is held against what of it has been handed on; where too much is in
/// between, the connection is ended.
///
/// Memory: bounded by the open connections, whatever ids and however many peers come and go.
/// Confined to the thread of its server.
class Peers {
 public:
  using Clock = std::chrono::steady_clock;

  struct Limits {
    double messages_per_second = 0.0;  ///< Of one peer; as many may come at once.
    std::int64_t connection_bytes = 0;
    std::int64_t total_bytes = 0;
    int connections = 0;
    std::chrono::milliseconds handshake{0};  ///< For how long a handshake may last.
  };

  /// `monitor` must outlive it and read `kEvents`.
  Peers(Monitor& monitor, const Limits& limits) : monitor_(monitor), limits_(limits) {}

  static constexpr int kEvents =
      ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED;

  /// Counts a message of `bytes` that came on the connection with this descriptor (-1: inproc,
  /// which has no limits). False: the peer is over its rate.
  bool Admit(const PeerId& peer, int fd, std::int64_t bytes, Clock::time_point now);

  /// Learns of connections that came and went, and now and then ends those over a limit. To be
  /// called several times a second.
  void Update(Clock::time_point now);

  /// Connections whose handshake failed.
  std::int64_t rejected() const { return rejected_; }
  /// Connections that were ended because they were over a limit.
  std::int64_t ended() const { return ended_; }

 private:
  struct Bucket {
    double tokens = 0.0;
    Clock::time_point filled;
  };
  struct Peer {
    int fd = -1;
    std::int64_t delivered = 0;  // Bytes, with an allowance for framing.
    Bucket bucket;
  };
  struct Connection {
    Clock::time_point accepted;
    PeerId peer;  // Empty: it has sent no message yet.
  };

  void ReadEvents(Clock::time_point now);
  void CountRejected(Clock::time_point now);
  void EndOverfull();
  void End(int fd);
  bool TakeToken(Bucket& bucket, Clock::time_point now);
  /// Bytes received on a connection and not handed on; 0 where the kernel does not say.
  std::int64_t Pending(int fd, const Connection& connection);

  Monitor& monitor_;
  const Limits limits_;
  std::map<int, Connection> connections_;  // By descriptor.
  std::unordered_map<PeerId, Peer> peers_;
  Bucket strangers_;  // Of all whose connection is not known any more.
  std::int64_t accepted_ = 0;
  std::int64_t succeeded_ = 0;
  std::int64_t rejected_ = 0;
  std::int64_t ended_ = 0;
  Clock::time_point next_check_;
};

}  // namespace slalom::transport
