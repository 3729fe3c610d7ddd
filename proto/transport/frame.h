#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <zmq.hpp>

namespace slalom::transport {

/// One part of a message: bytes that move through ZeroMQ without being copied. They start on a
/// multiple of 8 bytes in memory. Movable. `Share` gives another reference to the same bytes, which
/// must not be changed from then on.
class Frame {
 public:
  Frame() = default;
  /// A frame of `size` bytes, which the caller writes before it sends them.
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
  /// Takes over a received part, or copies it if it does not start on a multiple of 8 bytes.
  explicit Frame(zmq::message_t message);

  mutable zmq::message_t message_;
};

/// A message always has two parts; the payload is often empty.
struct Message {
  Frame header;
  Frame payload;
};

}  // namespace slalom::transport
