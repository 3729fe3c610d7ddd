#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages.h"

namespace slalom::proto {

/// A header of each kind with every field set, and the payload that it goes with.
struct Example {
  Header header;
  std::string payload;
};
std::vector<Example> Examples();

inline std::span<const std::byte> Bytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

/// A frame put together by hand: a prefix of this version and number with the right checksum before
/// `protobuf`. Shares nothing with `Encode`.
std::string FrameByHand(int major, int minor, int number, std::string_view protobuf,
                        std::string_view payload = "");

/// All that a header holds, as text.
std::string Print(const Header& header);

}  // namespace slalom::proto
