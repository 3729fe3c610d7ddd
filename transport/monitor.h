#pragma once

#include <cstdint>
#include <optional>
#include <zmq.hpp>

#include "transport/context.h"

namespace slalom::transport {

/// Reads what ZeroMQ says of a socket's connections. Confined to the thread of its socket.
class Monitor {
 public:
  struct Event {
    int type = 0;            ///< One of ZMQ_EVENT_...
    std::int64_t value = 0;  ///< A descriptor, an errno, an interval, a reason: by type.
  };

  /// Of `socket`, which must outlive it and not be connected or bound yet. `events`: those to read,
  /// as an or of ZMQ_EVENT_...
  Monitor(Context& context, zmq::socket_t& socket, int events);
  ~Monitor();
  Monitor(const Monitor&) = delete;
  Monitor& operator=(const Monitor&) = delete;

  /// The next event that is there; does not wait. ZeroMQ holds 10,000 of them, then it makes no
  /// connection until some are read.
  std::optional<Event> Next();

  /// To poll for input.
  void* handle() { return reader_.handle(); }

 private:
  zmq::socket_t& socket_;
  zmq::socket_t reader_;
};

}  // namespace slalom::transport
