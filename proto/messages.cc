#include "proto/messages.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <bit>
#include <cstring>
#include <memory>
#include <utility>

#include "base/check.h"
#include "base/file.h"
#include "proto/bounds.h"
#include "proto/conversion.h"

namespace slalom::proto {
namespace {

static_assert(std::endian::native == std::endian::little, "the prefix is little-endian");

/// The prefix of a header's frame, in the order of its bytes.
struct Prefix {
  char magic[4] = {'S', 'L', 'L', 'M'};
  std::uint8_t major = kMajorVersion;
  std::uint8_t minor = kMinorVersion;
  std::uint16_t number = 0;
  std::uint64_t checksum = 0;
};
static_assert(sizeof(Prefix) == kPrefixBytes && std::is_trivially_copyable_v<Prefix>);

/// The checksum of the prefix (up to the checksum), the protobuf and the payload, each seeded with
/// the checksum of the part before.
std::uint64_t ChecksumOf(const Prefix& prefix, std::span<const std::byte> protobuf,
                         std::span<const std::byte> payload) {
  const auto start = std::as_bytes(std::span(&prefix, 1)).first(offsetof(Prefix, checksum));
  return base::Checksum(payload, base::Checksum(protobuf, base::Checksum(start)));
}

Refusal Bad(std::string text) {
  return {.code = RefusalCode::kBadMessage, .text = std::move(text)};
}

}  // namespace

std::string_view NameOf(const Header& header) {
  return EmptyMessage(header.index()).GetDescriptor()->name();
}

std::string Encode(const Header& header, std::span<const std::byte> payload) {
  const auto message = ToMessage(header);
  SLALOM_CHECK_EQ(FindFault(*message), "");
  Prefix prefix{.number = static_cast<std::uint16_t>(header.index() + 1)};
  std::string frame(kPrefixBytes, '\0');
  {
    google::protobuf::io::StringOutputStream stream(&frame);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);  // Otherwise the order of maps varies.
    SLALOM_CHECK(message->SerializeToCodedStream(&coded));
  }
  const auto protobuf = std::as_bytes(std::span(frame)).subspan(kPrefixBytes);
  SLALOM_CHECK_LE(protobuf.size(), kMaxHeaderBytes);
  prefix.checksum = ChecksumOf(prefix, protobuf, payload);
  std::memcpy(frame.data(), &prefix, sizeof(prefix));
  return frame;
}

std::string FindFault(const Header& header) { return FindFault(*ToMessage(header)); }

Refusal NoRoom(int max_connections) {
  return {.code = RefusalCode::kNotReady,
          .text = fmt::format("found {} connections, as many as service.max_connections or the "
                              "server's descriptors allow: this one ends",
                              max_connections)};
}

base::Result<Header, Refusal> Decode(std::span<const std::byte> frame,
                                     std::span<const std::byte> payload) {
  Prefix prefix;
  if (frame.size() < sizeof(prefix)) {
    return Bad(fmt::format("the header is {} bytes long, expected {} or more", frame.size(),
                           sizeof(prefix)));
  }
  std::memcpy(&prefix, frame.data(), sizeof(prefix));
  if (std::memcmp(prefix.magic, Prefix{}.magic, sizeof(prefix.magic)) != 0) {
    return Bad("the header does not begin with 'SLLM': not a message of Slalom");
  }
  if (prefix.major != kMajorVersion) {
    return Refusal{.code = RefusalCode::kWrongVersion,
                   .text = fmt::format("the message is of protocol {}.{}, expected {}.x",
                                       prefix.major, prefix.minor, kMajorVersion)};
  }
  const auto protobuf = frame.subspan(sizeof(prefix));
  if (protobuf.size() > kMaxHeaderBytes) {
    return Bad(fmt::format("the header holds {} bytes of protobuf, expected {} at most",
                           protobuf.size(), kMaxHeaderBytes));
  }
  if (const std::uint64_t found = ChecksumOf(prefix, protobuf, payload); found != prefix.checksum) {
    return Bad(fmt::format("the checksum is {:016x}, expected {:016x}: the message was damaged",
                           found, prefix.checksum));
  }
  if (prefix.number == 0 || prefix.number > std::variant_size_v<Header>) {
    return Refusal{
        .code = RefusalCode::kUnknownMessage,
        .text = fmt::format("message {} of protocol {}.{} is not known to {}.{}", prefix.number,
                            prefix.major, prefix.minor, kMajorVersion, kMinorVersion)};
  }
  const std::size_t index = prefix.number - 1u;
  const std::unique_ptr<google::protobuf::Message> message(EmptyMessage(index).New());
  const auto& type = *message->GetDescriptor();
  // Bad bytes from a peer get one answer. They must not make protobuf write to standard error.
  [[maybe_unused]] static const auto replaced = google::protobuf::SetLogHandler(nullptr);
  if (!ListsFit(type, protobuf) ||
      !message->ParseFromArray(protobuf.data(), static_cast<int>(protobuf.size()))) {
    return Bad(
        fmt::format("{}: the header cannot be parsed, or a list in it is too long", type.name()));
  }
  if (const std::string fault = FindFault(*message); !fault.empty()) {
    return Bad(fmt::format("{}: {}", type.name(), fault));
  }
  return ToHeader(index, *message);
}

}  // namespace slalom::proto
