#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

#include "proto/transport/monitor.h"

namespace slalom::transport {

/// Identifies a connection as long as it lasts.
using PeerId = std::string;

/// The connections of a server, and the limits on the resources of each.
///
/// ZeroMQ bounds the size of a part and the number of complete messages that wait, but neither the
/// number of parts nor the bytes of an incomplete message. This class therefore compares the bytes
/// that the kernel has received on a connection with those that have been handed on, and ends the
/// connection if the difference is too large.
///
/// Memory is bounded by the number of open connections, not by the ids and peers that come and go.
/// Confined to the thread of its server.
class Peers {
 public:
  using Clock = std::chrono::steady_clock;

  struct Limits {
    double messages_per_second = 0.0;  ///< Rate of one peer, which may send as many at once.
    std::int64_t connection_bytes = 0;
    std::int64_t total_bytes = 0;
    int connections = 0;
    std::chrono::milliseconds handshake{0};  ///< Longest time of a handshake.
  };

  /// `monitor` must outlive this object and read `kEvents`.
  Peers(Monitor& monitor, const Limits& limits) : monitor_(monitor), limits_(limits) {}

  static constexpr int kEvents =
      ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED;

  /// Counts a message of `bytes` that arrived on the connection with this descriptor (-1 for
  /// inproc, which has no limits). Returns false if the peer is over its rate.
  bool Admit(const PeerId& peer, int fd, std::int64_t bytes, Clock::time_point now);

  /// Learns of new and closed connections and, from time to time, ends those over a limit. Call it
  /// several times a second.
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
    PeerId peer;  // Empty until it has sent a message.
  };

  void ReadEvents(Clock::time_point now);
  void CountRejected(Clock::time_point now);
  void EndOverfull();
  void End(int fd);
  bool TakeToken(Bucket& bucket, Clock::time_point now);
  /// Bytes received on a connection and not handed on yet; 0 if the kernel does not tell.
  std::int64_t Pending(int fd, const Connection& connection);

  Monitor& monitor_;
  const Limits limits_;
  std::map<int, Connection> connections_;  // By descriptor.
  std::unordered_map<PeerId, Peer> peers_;
  Bucket strangers_;  // Shared by peers whose connection is no longer known.
  std::int64_t accepted_ = 0;
  std::int64_t succeeded_ = 0;
  std::int64_t rejected_ = 0;
  std::int64_t ended_ = 0;
  Clock::time_point next_check_;
};

}  // namespace slalom::transport
