#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "proto/messages.h"

namespace slalom::proto {

/// Appends the header as protobuf to `out`. The same header always gives the same bytes. Texts and
/// the lists of a status are made to fit, as `Encode` describes.
void AppendProtobuf(const Header& header, std::string* out);

/// Parses a header of the type at `index` in the list of `Header`. Its values may be out of bounds.
/// Returns nothing if the bytes are not a protobuf of that type, or if its lists are too long.
/// Requires: index < std::variant_size_v<Header>.
std::optional<Header> ParseProtobuf(std::size_t index, std::span<const std::byte> bytes);

}  // namespace slalom::proto
