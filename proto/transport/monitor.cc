#include "proto/transport/monitor.h"

#include <cstddef>
#include <cstring>
#include <string>

#include "base/check.h"
#include "base/error.h"

namespace slalom::transport {
namespace {

constexpr int kMaxEventsHeld = 10000;

}  // namespace

Monitor::Monitor(Context& context, zmq::socket_t& socket, int events)
    : socket_(socket), reader_(context.zmq(), zmq::socket_type::pair) {
  const std::string address = "inproc://" + context.NewName("monitor");
  if (zmq_socket_monitor(socket.handle(), address.c_str(), events) != 0) {
    throw base::Error("cannot watch a socket ({})", zmq_strerror(zmq_errno()));
  }
  reader_.set(zmq::sockopt::linger, 0);
  reader_.set(zmq::sockopt::rcvhwm, kMaxEventsHeld);
  reader_.connect(address);
}

Monitor::~Monitor() {
  // ZeroMQ's thread may be waiting for room, while it holds the lock that the next call needs.
  while (Next()) {
  }
  zmq_socket_monitor(socket_.handle(), nullptr, 0);
}

std::optional<Monitor::Event> Monitor::Next() {
  zmq::message_t what;
  if (zmq_msg_recv(what.handle(), reader_.handle(), ZMQ_DONTWAIT) < 0) return std::nullopt;
  // Type (16 bits) and value (32 bits) in one part, the address in a second one.
  Event event;
  std::uint16_t type = 0;
  std::uint32_t value = 0;
  SLALOM_CHECK_GE(what.size(), sizeof type + sizeof value);
  const auto* bytes = static_cast<const std::byte*>(what.data());
  std::memcpy(&type, bytes, sizeof type);
  std::memcpy(&value, bytes + sizeof type, sizeof value);
  event.type = type;
  event.value = static_cast<std::int32_t>(value);
  while (what.more()) {
    zmq::message_t rest;
    if (zmq_msg_recv(rest.handle(), reader_.handle(), ZMQ_DONTWAIT) < 0 || !rest.more()) break;
  }
  return event;
}

}  // namespace slalom::transport
