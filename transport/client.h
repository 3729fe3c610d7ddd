#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "transport/context.h"
#include "transport/frame.h"
#include "transport/security.h"

namespace slalom::transport {

struct ClientOptions {
  std::string endpoint;
  ClientSecurity security;
  std::int64_t max_message_bytes = 256 << 20;
  int queue_messages = 256;
  std::chrono::milliseconds heartbeat{2000};
};

/// The connecting end (DEALER). Connects in the background and again whenever the connection
/// breaks; then whatever was on its way is lost, which those above must notice and mend.
///
/// Confined to the thread that made it.
class Client {
 public:
  /// Throws `base::Error` where the endpoint is no address.
  Client(Context& context, const ClientOptions& options);

  /// False, with `message` as it was: the queue is full, or there is no connection yet.
  [[nodiscard]] bool Send(Message&& message);

  /// The next message, after at most `timeout`. None: none came.
  std::optional<Message> Receive(std::chrono::milliseconds timeout);

  /// Times the connection was (re)established, by now; a change means: say hello again.
  int connections();

  /// Throws the connection and all that is queued away and starts anew, for a peer that accepts and
  /// does not answer.
  void Reconnect();

  /// Of two clients of one thread, waits until either has something to receive, or `timeout`.
  static void WaitForAny(std::initializer_list<Client*> clients, std::chrono::milliseconds timeout);

 private:
  void Open();

  Context& context_;
  const ClientOptions options_;
  zmq::socket_t socket_;
  zmq::socket_t monitor_;
  int connections_ = 0;
};

}  // namespace slalom::transport
