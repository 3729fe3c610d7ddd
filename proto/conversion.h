#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <memory>

#include "proto/messages.h"

namespace slalom::proto {

/// The empty message of the type at `index` in the list of `Header`, as proto/slalom.proto has it.
/// Requires: index < std::variant_size_v<Header>.
const google::protobuf::Message& EmptyMessage(std::size_t index);

/// The message that a header mirrors. Texts and the lists of a status are made to fit, as `Encode`
/// describes.
std::unique_ptr<google::protobuf::Message> ToMessage(const Header& header);

/// The header that mirrors a message within its bounds, of the type at `index`.
Header ToHeader(std::size_t index, const google::protobuf::Message& message);

}  // namespace slalom::proto
