#pragma once

#include <span>
#include <string>

#include "proto/messages.h"

namespace slalom::proto {

/// Whether a header came from a peer, or is to be sent and `Encode` makes its texts and lists fit.
enum class Way { kReceived, kToBeSent };

/// What in a header is not within the bounds of messages.h: its field, what was found and what was
/// expected. Empty: nothing.
std::string FindFault(const Header& header, Way way);

/// Cuts a text to `kMaxTextBytes` and puts '?' for what is not printable ASCII.
std::string FitText(std::string_view text);

/// Whether the lists in the protobuf of a report or a status are within their bounds, by a walk
/// over the bytes that allocates nothing: the parser would first make all of a list. Bytes that are
/// no protobuf pass; the parser refuses them.
bool ReportListsFit(std::span<const std::byte> protobuf);
bool StatusListsFit(std::span<const std::byte> protobuf);

}  // namespace slalom::proto
