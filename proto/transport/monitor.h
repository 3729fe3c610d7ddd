#pragma once

#include <cstdint>
#include <optional>
#include <zmq.hpp>

#include "proto/transport/context.h"

namespace slalom::transport {

/// Reads the events that ZeroMQ reports of a socket's connections. One thread at a time may use it.
class Monitor {
 public:
  struct Event {
    int type = 0;            ///< One of ZMQ_EVENT_...
    std::int64_t value = 0;  ///< A descriptor, errno, interval or reason, depending on the type.
  };

  /// Watches `socket`, which must outlive the monitor and must not be connected or bound yet.
  /// `events` are those to read, a bitwise or of ZMQ_EVENT_...
  Monitor(Context& context, zmq::socket_t& socket, int events);
  ~Monitor();
  Monitor(const Monitor&) = delete;
  Monitor& operator=(const Monitor&) = delete;

  /// Returns the next event, or nothing if there is none yet; does not wait. ZeroMQ holds up to
  /// 10,000 events. Then it makes no more connections until some are read.
  std::optional<Event> Next();

  /// A socket to poll for input.
  void* handle() { return reader_.handle(); }

 private:
  zmq::socket_t& socket_;
  zmq::socket_t reader_;
};

}  // namespace slalom::transport
