#pragma once

#include <string_view>
#include <utility>

#include "proto/messages.h"
#include "proto/transport/server.h"

namespace slalom::replay {

/// Sends replies to peers: through the server's socket, or into a test. Thread-compatible.
class ReplySender {
 public:
  using Sent = transport::Server::Sent;

  virtual ~ReplySender() = default;
  /// As `transport::Server::Send`.
  [[nodiscard]] virtual Sent Send(const transport::PeerId& peer, transport::Message&& message) = 0;
  /// Notes a refusal, for metrics and log. It may not have been sent.
  virtual void NoteRefusal(const transport::PeerId&, proto::RefusalCode, std::string_view) {}
};

/// Makes a message of a header and a payload. Requires the same as `proto::Encode`.
inline transport::Message MakeMessage(const proto::Header& header, transport::Frame payload = {}) {
  return {transport::Frame::Copy(proto::Encode(header, payload.bytes())), std::move(payload)};
}

}  // namespace slalom::replay
