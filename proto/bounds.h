#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace slalom::proto {

/// Checks a message against the bounds in proto/slalom.proto. Returns what is wrong (the field,
/// what was found and what was expected), or an empty text if everything is within bounds.
std::string FindFault(const google::protobuf::Message& message);

/// Whether the lists and maps in the protobuf of a message are within their bounds, and no message
/// in it comes twice. This walks over the bytes and does not allocate, whereas the parser would
/// first build the whole list. Bytes that are not a protobuf pass; the parser refuses them.
bool ListsFit(const google::protobuf::Descriptor& type, std::span<const std::byte> protobuf);

/// Whether a string is a name (`base::IsName`) and not a text.
bool IsName(const google::protobuf::FieldDescriptor& field);

/// Cuts a text to `kMaxTextBytes` and replaces bytes that are not printable ASCII by '?'.
std::string FitText(std::string_view text);

}  // namespace slalom::proto
