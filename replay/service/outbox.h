#pragma once

#include <utility>

#include "proto/messages.h"
#include "transport/server.h"

namespace slalom::replay {

/// Where answers go: the server's socket, or a test. Thread-compatible.
class Outbox {
 public:
  using Sent = transport::Server::Sent;

  virtual ~Outbox() = default;
  /// As `transport::Server::Send`.
  [[nodiscard]] virtual Sent Send(const transport::PeerId& peer, transport::Message&& message) = 0;
};

/// A message of this header and payload. Requires: as `proto::Encode`.
inline transport::Message MakeMessage(const proto::Header& header, transport::Frame payload = {}) {
  return {transport::Frame::Copy(proto::Encode(header, payload.bytes())), std::move(payload)};
}

}  // namespace slalom::replay
