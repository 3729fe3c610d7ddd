#pragma once

#include <chrono>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "transport/context.h"
#include "transport/frame.h"
#include "transport/monitor.h"
#include "transport/security.h"

namespace slalom::transport {

struct ClientOptions {
  std::string endpoint;          ///< "tcp://HOST:PORT", "ipc://PATH" or "inproc://NAME".
  ClientSecurity security = {};  ///< Not for inproc.
  std::int64_t max_message_bytes = 256 << 20;  ///< Larger parts end the connection.
  int queue_messages = 256;                    ///< To be sent.
  std::chrono::milliseconds heartbeat{
      2000};  ///< Of a silent connection; gone after three. At most half an hour.
};

/// The connecting end (DEALER). Connects in the background and again whenever the connection
/// breaks, after 0.1 s at first and 1 s at last; then whatever was on its way is lost, which those
/// above must notice and mend. Host names are looked up each time. Over inproc it counts as
/// connected from the start, and only `Reconnect` connects it again.
///
/// Confined to the thread that made it.
class Client {
 public:
  /// Throws `base::Error` where the endpoint is none.
  Client(Context& context, const ClientOptions& options);
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// False, with `message` as it was: the queue is full, or there is no connection yet. Never
  /// waits.
  [[nodiscard]] bool Send(Message&& message);

  /// The next message, after at most `timeout`. None: none came, or a signal came. Messages that
  /// have not two parts are passed over.
  std::optional<Message> Receive(std::chrono::milliseconds timeout);

  /// Times the connection was (re)established, by now; a change means: say hello again.
  int connections();

  /// Whether there is a connection, by now.
  bool connected();

  /// Why there is no connection, in words for a log; empty where there is one.
  std::string trouble();

  /// Throws the connection and all that is queued away and starts anew, for a peer that accepts and
  /// does not answer.
  void Reconnect();

  /// Of several clients of one thread, waits until any has something to receive, or `timeout`, or a
  /// signal.
  static void WaitForAny(std::initializer_list<Client*> clients, std::chrono::milliseconds timeout);

 private:
  using Clock = std::chrono::steady_clock;

  void Open();
  void Update();
  void Warn(const char* trouble);

  Context& context_;
  const ClientOptions options_;
  zmq::socket_t socket_;
  std::optional<Monitor> monitor_;  // After its socket, to go before it.
  int connections_ = 0;
  bool connected_ = false;
  std::string trouble_;
  std::string warned_;  // The last trouble that was said.
  /// When ZeroMQ last lost the connection without saying that it will try again.
  std::optional<Clock::time_point> given_up_;
};

}  // namespace slalom::transport
