#include "proto/messages.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/check.h"
#include "base/file.h"
#include "proto/bounds.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

template <class T>
concept IsStruct = requires(T& m) {
  T::Fields(m);
};
template <class T>
concept IsMap = requires {
  typename T::mapped_type;
};
template <class T>
concept IsList = IsStruct<typename T::value_type>;

/// How a number is read and written: of an int and an enum as uint32.
template <class T>
constexpr auto kAccess = std::pair(&Reflection::GetUInt32, &Reflection::SetUInt32);
template <>
constexpr auto kAccess<std::uint64_t> = std::pair(&Reflection::GetUInt64, &Reflection::SetUInt64);
template <>
constexpr auto kAccess<std::int64_t> = std::pair(&Reflection::GetInt64, &Reflection::SetInt64);
template <>
constexpr auto kAccess<double> = std::pair(&Reflection::GetDouble, &Reflection::SetDouble);
template <>
constexpr auto kAccess<bool> = std::pair(&Reflection::GetBool, &Reflection::SetBool);

/// Calls `visit` with each member of a message's struct and the field that it mirrors.
template <class Struct, class Visitor>
void VisitFields(Struct& m, const Descriptor& type, const Visitor& visit) {
  std::apply(
      [&](auto&... members) {
        SLALOM_CHECK_EQ(sizeof...(members), static_cast<std::size_t>(type.field_count()));
        int i = 0;
        (visit(members, type.field(i++)), ...);
      },
      std::remove_const_t<Struct>::Fields(m));
}

template <class Struct>
void WriteFields(const Struct& m, Message* to);

template <class T>
void Write(const T& value, const FieldDescriptor* field, Message* to) {
  const Reflection& fields = *to->GetReflection();
  if constexpr (IsStruct<T>) {
    WriteFields(value, fields.MutableMessage(to, field));
  } else if constexpr (IsMap<T>) {
    for (const auto& [key, mapped] : value) {
      Message* const entry = fields.AddMessage(to, field);
      Write(key, field->message_type()->map_key(), entry);
      Write(mapped, field->message_type()->map_value(), entry);
    }
  } else if constexpr (std::is_same_v<T, std::string>) {
    fields.SetString(to, field, IsName(*field) ? value : FitText(value));
  } else if constexpr (IsList<T>) {
    for (const auto& entry : value) WriteFields(entry, fields.AddMessage(to, field));
  } else if constexpr (std::is_enum_v<T>) {
    Write(static_cast<int>(value), field, to);
  } else {
    (fields.*kAccess<T>.second)(to, field, value);
  }
}

template <class Struct>
void WriteFields(const Struct& m, Message* to) {
  VisitFields(m, *to->GetDescriptor(),
              [to](const auto& member, const FieldDescriptor* field) { Write(member, field, to); });
}

template <class Struct>
void ReadFields(const Message& from, Struct* m);

template <class T>
void Read(const Message& from, const FieldDescriptor* field, T* value) {
  const Reflection& fields = *from.GetReflection();
  if constexpr (IsStruct<T>) {
    ReadFields(fields.GetMessage(from, field), value);
  } else if constexpr (IsMap<T>) {
    for (int i = 0; i < fields.FieldSize(from, field); ++i) {
      const Message& entry = fields.GetRepeatedMessage(from, field, i);
      std::string key;
      Read(entry, field->message_type()->map_key(), &key);
      Read(entry, field->message_type()->map_value(), &(*value)[std::move(key)]);
    }
  } else if constexpr (std::is_same_v<T, std::string>) {
    *value = fields.GetString(from, field);
  } else if constexpr (IsList<T>) {
    value->reserve(static_cast<std::size_t>(fields.FieldSize(from, field)));
    for (int i = 0; i < fields.FieldSize(from, field); ++i) {
      ReadFields(fields.GetRepeatedMessage(from, field, i), &value->emplace_back());
    }
  } else {
    const auto found = (fields.*kAccess<T>.first)(from, field);
    if constexpr (std::is_same_v<T, int>) {  // One without a bound may not fit.
      *value = static_cast<int>(std::min(found, std::uint32_t{std::numeric_limits<int>::max()}));
    } else {
      *value = static_cast<T>(found);
    }
  }
}

template <class Struct>
void ReadFields(const Message& from, Struct* m) {
  VisitFields(*m, *from.GetDescriptor(),
              [&from](auto& member, const FieldDescriptor* field) { Read(from, field, &member); });
}

/// Moves roles for which there is no room to the count of those.
void MakeFit(wire::StatusReply* status) {
  // Besides its own bytes, a role takes a tag and a length, and so does `omitted`.
  constexpr std::size_t kMargin = 8;
  std::size_t size = kMargin;
  int count = 0;
  auto& roles = *status->mutable_roles();
  const auto end = std::remove_if(roles.begin(), roles.end(), [&](const wire::RoleStatus& role) {
    const std::size_t added = role.ByteSizeLong() + kMargin;
    if (count >= kMaxRoles || size + added > kMaxHeaderBytes) return true;
    size += added;
    ++count;
    return false;
  });
  status->set_omitted(status->omitted() + static_cast<std::uint32_t>(roles.end() - end));
  roles.erase(end, roles.end());
}

template <std::size_t... kIndex>
Header EmptyHeader(std::size_t index, std::index_sequence<kIndex...>) {
  Header header;
  (void)((index == kIndex && (header.emplace<kIndex>(), true)) || ...);
  return header;
}

/// The empty message of the type at `index` in the list of `Header`, as proto/slalom.proto has it.
/// Requires: index < std::variant_size_v<Header>.
const Message& EmptyMessage(std::size_t index) {
  const auto* const file = wire::Hello::descriptor()->file();
  return *google::protobuf::MessageFactory::generated_factory()->GetPrototype(
      file->message_type(static_cast<int>(index)));
}

/// The message that a header mirrors. Texts and the lists of a status are made to fit, as `Encode`
/// describes.
std::unique_ptr<Message> ToMessage(const Header& header) {
  std::unique_ptr<Message> message(EmptyMessage(header.index()).New());
  std::visit([&](const auto& m) { WriteFields(m, message.get()); }, header);
  if (auto* const status = dynamic_cast<wire::StatusReply*>(message.get())) MakeFit(status);
  return message;
}

/// The header that mirrors a message within its bounds, of the type at `index`.
Header ToHeader(std::size_t index, const Message& message) {
  Header header = EmptyHeader(index, std::make_index_sequence<std::variant_size_v<Header>>());
  std::visit([&](auto& m) { ReadFields(message, &m); }, header);
  return header;
}

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

StatusReply Merge(std::vector<StatusReply> statuses) {
  StatusReply merged;
  std::map<std::pair<std::string, std::string>, std::size_t> places;  // Of role and name.
  for (StatusReply& status : statuses) {
    merged.omitted += status.omitted;
    for (RoleStatus& role : status.roles) {
      const auto [place, is_new] =
          places.try_emplace({role.report.role, role.report.name}, merged.roles.size());
      if (is_new) {
        merged.roles.push_back(std::move(role));
      } else if (role.age_s < merged.roles[place->second].age_s) {
        merged.roles[place->second] = std::move(role);
      }
    }
  }
  return merged;
}

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
