#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "proto/transport/keys.h"

namespace slalom::transport {

/// The part that all sockets of a process share: ZeroMQ's threads and, once a server listens beyond
/// the process, the thread that decides who may connect to it (ZAP, RFC 27). Must outlive its
/// sockets. Thread-safe.
class Context {
 public:
  /// `io_threads`: the number of threads that encrypt and copy data between sockets and the kernel.
  /// Requires: io_threads >= 1. Throws `base::Error` if its threads cannot be started.
  explicit Context(int io_threads = 1);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

 private:
  friend class Server;
  friend class Client;
  friend class Monitor;
  class Authenticator;

  /// Lets the server of this ZAP domain accept the keys in `allowed` and no others, or, without a
  /// list, everybody who connects in plaintext. A domain without this call is closed to all.
  void Authenticate(const std::string& domain, std::optional<AllowList> allowed);
  void Forget(const std::string& domain);

  /// Returns a new name of the form "PREFIX-N".
  std::string NewName(const std::string& prefix);
  zmq::context_t& zmq() { return context_; }

  zmq::context_t context_;
  std::atomic<std::uint64_t> num_names_ = 0;
  std::unique_ptr<Authenticator> authenticator_;
};

}  // namespace slalom::transport
