#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "transport/keys.h"

namespace slalom::transport {

/// The sockets' common ground: ZeroMQ's threads and, once there is a server that listens beyond the
/// process, the thread that answers who may connect to it (ZAP, RFC 27). Must outlive its sockets.
/// Thread-safe.
class Context {
 public:
  /// `io_threads` >= 1: threads that copy between sockets and the kernel and encrypt.
  explicit Context(int io_threads = 1);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

 private:
  friend class Server;
  friend class Client;
  friend class Monitor;
  class Authenticator;

  /// Lets the server of this ZAP domain accept the keys of `allowed` and no others; none: whoever
  /// connects in plaintext. A domain that is not named is closed to all.
  void Authenticate(const std::string& domain, std::optional<AllowList> allowed);
  void Forget(const std::string& domain);

  /// "PREFIX-N" that was not given before.
  std::string NewName(const std::string& prefix);
  zmq::context_t& zmq() { return context_; }

  zmq::context_t context_;
  std::atomic<std::uint64_t> num_names_ = 0;
  std::unique_ptr<Authenticator> authenticator_;
};

}  // namespace slalom::transport
