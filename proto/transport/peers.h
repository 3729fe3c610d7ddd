#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "base/mutex.h"
#include "proto/transport/monitor.h"

namespace slalom::transport {

/// Identifies a connection as long as it lasts.
using PeerId = std::string;

/// Why a server ended a connection.
enum class EndReason {
  kHandshakes,   ///< More connections than the limit had not sent a message yet; the oldest end.
  kConnections,  ///< It was beyond the limit on connections.
  kBytes,        ///< More bytes than the limit waited on it, or on all connections.
};
inline constexpr std::array kEndReasons = {EndReason::kHandshakes, EndReason::kConnections,
                                           EndReason::kBytes};
/// "handshakes", "connections" or "bytes".
std::string_view ToString(EndReason reason);

/// The connections of a server, and the limits on the resources of each.
///
/// A connection counts as open once it has sent a message, which nobody can without an allowed key
/// (if there are keys). Those that have not are bounded by a limit of their own, so that strangers
/// who say nothing take no place of peers.
///
/// ZeroMQ bounds the size of a part and the number of complete messages that wait, but neither the
/// number of parts nor the bytes of an incomplete message. This class therefore compares the bytes
/// that the kernel has received on a connection with those that have been handed on, and ends the
/// connection if the difference is too large.
///
/// Memory is bounded by the number of open connections, not by the ids and peers that come and go.
/// Thread-safe.
class Peers {
 public:
  using Clock = std::chrono::steady_clock;

  struct Limits {
    double messages_per_second = 0.0;  ///< Rate of one peer, which may send as many at once.
    std::int64_t connection_bytes = 0;
    std::int64_t total_bytes = 0;
    int connections = 0;                     ///< Open ones, those of operators aside.
    int operators = 0;                       ///< The same for peers with an operator's key.
    int handshakes = 0;                      ///< Connections that have not sent a message.
    int newcomers = 0;                       ///< These, while they are young, and those refused.
    std::chrono::milliseconds handshake{0};  ///< Longest time of a handshake.
  };

  /// `monitor` must outlive this object and read `kEvents`.
  Peers(Monitor& monitor, const Limits& limits) : limits_(limits), monitor_(monitor) {}

  static constexpr int kEvents =
      ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED;

  enum class Admission {
    kYes,
    kTooFast,  ///< The peer is over its rate.
    kNoRoom,   ///< There are as many connections as the limit, so this one ends in a moment.
  };
  /// Counts a message of `bytes` that arrived on the connection with this descriptor (-1 for
  /// inproc, which has no limits).
  Admission Admit(const PeerId& peer, int fd, std::int64_t bytes, bool is_operator,
                  Clock::time_point now) EXCLUDES(mutex_);

  /// Learns of new and closed connections and ends those over a limit. Call it about a hundred
  /// times a second, because ZeroMQ takes every connection that comes meanwhile.
  void Update(Clock::time_point now) EXCLUDES(mutex_);

  /// What became of the connections so far.
  struct Counts {
    std::int64_t rejected = 0;                             ///< Their handshake failed.
    std::array<std::int64_t, kEndReasons.size()> ended{};  ///< They were over a limit.
    int open = 0;                                          ///< Now.
  };
  Counts counts() const EXCLUDES(mutex_);

 private:
  struct Bucket {
    double tokens = 0.0;
    Clock::time_point filled;
  };
  struct Peer {
    int fd = -1;
    std::int64_t delivered = 0;  // Bytes, with an allowance for framing.
    Bucket bucket;
    bool has_room = true;
  };
  struct Connection {
    Clock::time_point accepted;
    PeerId peer;  // Empty until it has sent a message.
    bool is_operator = false;
    std::optional<Clock::time_point> refused;  // When it was found to be beyond the limit.
    bool ended = false;                        // ZeroMQ has not closed it yet.
  };

  /// Returns whether there were any.
  bool ReadEvents(Clock::time_point now) REQUIRES(mutex_);
  void CountRejected(Clock::time_point now) REQUIRES(mutex_);
  bool HasRoom(bool is_operator) const REQUIRES(mutex_);
  void EndNewcomers(Clock::time_point now) REQUIRES(mutex_);
  void EndOverfull() REQUIRES(mutex_);
  void End(int fd, EndReason reason) REQUIRES(mutex_);
  bool TakeToken(Bucket& bucket, Clock::time_point now) REQUIRES(mutex_);
  /// Bytes received on a connection and not handed on yet; 0 if the kernel does not tell.
  std::int64_t Pending(int fd, const Connection& connection) REQUIRES(mutex_);

  const Limits limits_;
  mutable base::Mutex mutex_;
  Monitor& monitor_ GUARDED_BY(mutex_);
  std::map<int, Connection> connections_ GUARDED_BY(mutex_);  // By descriptor.
  std::unordered_map<PeerId, Peer> peers_ GUARDED_BY(mutex_);
  Bucket strangers_ GUARDED_BY(mutex_);  // Shared by peers whose connection is no longer known.
  std::int64_t accepted_ GUARDED_BY(mutex_) = 0;
  std::int64_t succeeded_ GUARDED_BY(mutex_) = 0;
  std::int64_t rejected_ GUARDED_BY(mutex_) = 0;
  std::array<std::int64_t, kEndReasons.size()> ended_ GUARDED_BY(mutex_){};
  Clock::time_point next_check_ GUARDED_BY(mutex_);
};

}  // namespace slalom::transport
