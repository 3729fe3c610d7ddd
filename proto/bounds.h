#pragma once

#include <span>
#include <string>

#include "proto/messages.h"

namespace slalom::proto {

/// Whether a header was received from a peer, or is to be sent, in which case `Encode` makes its
/// texts and lists fit.
enum class Way { kReceived, kToBeSent };

/// Checks a header against the bounds in proto/messages.h. Returns what is wrong (the field, what
/// was found and what was expected), or an empty text if everything is within bounds.
std::string FindFault(const Header& header, Way way);

/// Cuts a text to `kMaxTextBytes` and replaces bytes that are not printable ASCII by '?'.
std::string FitText(std::string_view text);

/// Whether the lists in the protobuf of a hello, a report or a status are within their bounds.
/// These walk over the bytes and do not allocate, whereas the parser would first build the whole
/// list. Bytes that are not a protobuf pass; the parser refuses them.
bool HelloListsFit(std::span<const std::byte> protobuf);
bool ReportListsFit(std::span<const std::byte> protobuf);
bool StatusListsFit(std::span<const std::byte> protobuf);

}  // namespace slalom::proto
