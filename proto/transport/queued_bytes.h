#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <zmq.hpp>

#include "proto/transport/peers.h"

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

}  // namespace slalom::transport
