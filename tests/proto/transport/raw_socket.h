#pragma once

#include <cstddef>
#include <string>
#include <string_view>

/// TCP without ZeroMQ: what a stranger on the port may do.

namespace slalom::transport::test {

/// A stream; reading gives up after a minute by throwing. The greeting and READY of ZMTP 3.0 with
/// the NULL mechanism are at hand, so that it can be a peer that then falls silent.
class RawSocket {
 public:
  /// Connects to "tcp://127.0.0.1:PORT".
  explicit RawSocket(const std::string& endpoint);
  /// Takes over a descriptor.
  explicit RawSocket(int fd) : fd_(fd) {}
  ~RawSocket();
  RawSocket(RawSocket&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  /// False: the other side has closed the connection.
  bool Write(std::string_view bytes);
  /// Reads on until the other side closes.
  void ReadToEnd();
  std::string ReadExactly(std::size_t num_bytes);

  /// Greeting and READY of a DEALER, and those of the other side; then messages may follow.
  void ShakeHands();

 private:
  int fd_ = -1;
};

/// Listens on a free port of 127.0.0.1 and accepts only when asked.
class RawListener {
 public:
  RawListener();
  ~RawListener();
  RawListener(const RawListener&) = delete;
  RawListener& operator=(const RawListener&) = delete;

  const std::string& endpoint() const { return endpoint_; }
  RawSocket Accept();

 private:
  int fd_ = -1;
  std::string endpoint_;
};

}  // namespace slalom::transport::test
