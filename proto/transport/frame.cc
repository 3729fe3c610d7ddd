#include "proto/transport/frame.h"

#include <cstdint>
#include <cstring>
#include <utility>

namespace slalom::transport {

Frame Frame::Copy(std::span<const std::byte> bytes) {
  Frame frame(bytes.size());
  if (!bytes.empty()) std::memcpy(frame.message_.data(), bytes.data(), bytes.size());
  return frame;
}

Frame Frame::Copy(std::string_view bytes) { return Copy(std::as_bytes(std::span(bytes))); }

Frame Frame::Share() const {
  Frame other;
  other.message_.copy(message_);
  return other;
}

std::span<const std::byte> Frame::bytes() const {
  return {static_cast<const std::byte*>(message_.data()), message_.size()};
}

std::span<std::byte> Frame::mutable_bytes() {
  return {static_cast<std::byte*>(message_.data()), message_.size()};
}

Frame::Frame(zmq::message_t message) {
  const auto address = reinterpret_cast<std::uintptr_t>(message.data());
  if (address % alignof(std::uint64_t) == 0) {
    message_ = std::move(message);
    return;
  }
  // ZeroMQ reads several small parts into one buffer, into which they then point.
  message_.rebuild(message.data(), message.size());
}

}  // namespace slalom::transport
