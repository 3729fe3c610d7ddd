#pragma once

#include <chrono>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <zmq.hpp>

#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "proto/transport/monitor.h"
#include "proto/transport/security.h"

namespace slalom::transport {

struct ClientOptions {
  std::string endpoint;          ///< "tcp://HOST:PORT", "ipc://PATH" or "inproc://NAME".
  ClientSecurity security = {};  ///< Not used over inproc.
  std::int64_t max_message_bytes = 256 << 20;  ///< A larger part ends the connection.
  int queue_messages = 256;                    ///< Messages that may wait to be sent.
  /// Interval of heartbeats on a silent connection, at most half an hour. After three without an
  /// answer the connection counts as lost.
  std::chrono::milliseconds heartbeat{2000};
};

/// The connecting end (a ZeroMQ DEALER socket).
///
/// It connects in the background. Calls of its methods connect it again after a failed attempt or a
/// broken connection, with pauses that grow from 0.1 s to 1 s. Host names are looked up each time.
/// Messages that were on their way when the connection broke are lost; the layer above must notice
/// this and send them again. Over inproc the client counts as connected from the start, and only
/// `Reconnect` connects it again.
///
/// Confined to the thread that made it.
class Client {
 public:
  /// Throws `base::Error` if the endpoint is not valid.
  Client(Context& context, const ClientOptions& options);
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Sends a message without waiting. Returns false and leaves `message` unchanged if the queue is
  /// full or there is no connection yet.
  [[nodiscard]] bool Send(Message&& message);

  /// Waits for at most `timeout` and returns the next message, or nothing if none arrived or a
  /// signal interrupted the wait. Messages that do not have two parts are dropped.
  std::optional<Message> Receive(std::chrono::milliseconds timeout);

  /// Number of times that the connection has been established. After a change, the caller must say
  /// hello again.
  int connections();

  /// Whether there is a connection now.
  bool connected();

  /// Reason why there is no connection, in words for a log; empty if there is one.
  std::string trouble();

  /// Drops the connection and everything queued, and connects again. Meant for a peer that accepts
  /// connections but does not answer.
  void Reconnect();

  /// Waits until any of several clients of one thread has something to receive, until `timeout`, or
  /// until a signal arrives.
  static void WaitForAny(std::span<Client* const> clients, std::chrono::milliseconds timeout);
  static void WaitForAny(std::initializer_list<Client*> clients,
                         std::chrono::milliseconds timeout) {
    WaitForAny(std::span(clients.begin(), clients.size()), timeout);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Open();
  void Update();
  void Warn(const char* trouble);

  Context& context_;
  const ClientOptions options_;
  zmq::socket_t socket_;
  std::optional<Monitor> monitor_;  // Declared after its socket, to be destroyed before it.
  int connections_ = 0;
  bool connected_ = false;
  std::string trouble_;
  std::string warned_;               // The last trouble that was logged.
  std::chrono::milliseconds pause_;  // Before the next attempt, if this one fails.
  std::optional<Clock::time_point> retry_at_;
};

}  // namespace slalom::transport
