#pragma once

#include <memory>
#include <zmq.hpp>

#include "transport/keys.h"

namespace slalom::transport {

/// The sockets' common ground: ZeroMQ's threads and, once a server asks for CURVE, the thread that
/// answers whether a key is on its allow list (ZAP, RFC 27). Must outlive its sockets.
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
  class Authenticator;

  /// Lets a server of this ZAP domain accept the keys of `allowed`.
  void Authenticate(const std::string& domain, AllowList allowed);
  zmq::context_t& zmq() { return context_; }

  zmq::context_t context_;
  std::unique_ptr<Authenticator> authenticator_;
};

}  // namespace slalom::transport
