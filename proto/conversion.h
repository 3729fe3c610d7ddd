#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "proto/messages.h"

namespace slalom::proto {

/// Appends the header as protobuf. The same header gives the same bytes. Texts and a status are
/// made to fit, as `Encode` says.
void AppendProtobuf(const Header& header, std::string* out);

/// The header of this index in the list, with values that may be out of bounds. None: the bytes are
/// no protobuf of it, or its lists are too long. Requires: index < std::variant_size_v<Header>.
std::optional<Header> ParseProtobuf(std::size_t index, std::span<const std::byte> bytes);

}  // namespace slalom::proto
