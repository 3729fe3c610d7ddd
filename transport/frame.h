#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <zmq.hpp>

namespace slalom::transport {

/// One part of a message: bytes that move through ZeroMQ without being copied. Movable; `Share`
/// gives another reference to the same bytes, which must then not be changed. Starts on a multiple
/// of 8 bytes in memory.
class Frame {
 public:
  Frame() = default;
  /// Bytes that the caller writes before it sends them.
  explicit Frame(std::size_t size) : message_(size) {}
  static Frame Copy(std::span<const std::byte> bytes);
  static Frame Copy(std::string_view bytes);

  Frame Share() const;

  std::size_t size() const { return message_.size(); }
  std::span<const std::byte> bytes() const;
  std::span<std::byte> mutable_bytes();

 private:
  friend class Server;
  friend class Client;
  /// Takes a part as it was received, and copies it where it does not start on 8 bytes.
  explicit Frame(zmq::message_t message);

  mutable zmq::message_t message_;
};

/// What is sent: always two parts, the second often empty.
struct Message {
  Frame header;
  Frame payload;
};

}  // namespace slalom::transport
