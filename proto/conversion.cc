#include "proto/conversion.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/check.h"
#include "proto/bounds.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

/// Converts a number from the wire to an int. One that does not fit becomes the largest int, which
/// exceeds every bound.
int ToInt(std::uint32_t value) {
  return static_cast<int>(std::min<std::uint32_t>(value, std::numeric_limits<int>::max()));
}

/// The classes that protoc made of the messages, in the order of `Header`.
using WireMessages =
    std::tuple<wire::Hello, wire::Welcome, wire::Insert, wire::InsertAck, wire::Goodbye,
               wire::SampleRequest, wire::SampleReply, wire::PriorityUpdate, wire::SnapshotRequest,
               wire::Snapshot, wire::Report, wire::StatusRequest, wire::StatusReply, wire::Refusal>;
static_assert(std::tuple_size_v<WireMessages> == std::variant_size_v<Header>);

template <class Message, std::size_t... kIndex>
constexpr std::size_t IndexOf(std::index_sequence<kIndex...>) {
  return ((std::is_same_v<Message, std::variant_alternative_t<kIndex, Header>> ? kIndex : 0) + ...);
}
template <class Message>
using WireOf =
    std::tuple_element_t<IndexOf<Message>(std::make_index_sequence<std::variant_size_v<Header>>()),
                         WireMessages>;

template <class T>
constexpr bool kIsMap = requires {
  typename T::mapped_type;
};
template <class T>
constexpr bool kIsList = false;
template <class T>
constexpr bool kIsList<std::vector<T>> = true;
template <class T>
constexpr bool kIsText = std::is_same_v<T, std::string>;

template <class Message, class Wire>
void Write(const Message& message, Wire& wire);

/// Visits a message's fields and sets them in the wire's message.
template <class Wire>
class FieldWriter {
 public:
  explicit FieldWriter(Wire& wire) : wire_(wire) {}

  template <class T, class Access, class Bound>
  void operator()(int, std::string_view, const T& value, const Access& access, const Bound&,
                  std::string_view) {
    if constexpr (HasFields<T>) {
      Write(value, *access.mutable_(wire_));
    } else if constexpr (kIsMap<T>) {
      auto& map = *access.mutable_(wire_);
      for (const auto& [key, entry] : value) {
        if constexpr (kIsText<typename T::mapped_type>) {
          map[key] = FitText(entry);
        } else {
          map[key] = entry;
        }
      }
    } else {
      using OnWire = std::decay_t<decltype(access.get(wire_))>;
      if constexpr (std::is_same_v<T, int> || std::is_enum_v<T>) {
        static_assert(std::is_same_v<OnWire, std::uint32_t>);
        access.set(wire_, static_cast<std::uint32_t>(value));
      } else if constexpr (std::is_same_v<Bound, Text>) {
        access.set(wire_, FitText(value));
      } else {
        static_assert(std::is_same_v<OnWire, T>);
        access.set(wire_, value);
      }
    }
  }

 private:
  Wire& wire_;
};

template <class Message, class Wire>
void Write(const Message& message, Wire& wire) {
  FieldWriter<Wire> writer(wire);
  Message::Visit(message, writer);
}

/// A status is made to fit: roles for which there is no room are counted.
void Write(const StatusReply& m, wire::StatusReply& w) {
  // Besides its own bytes, a role takes a tag and a length, and so does `omitted`.
  constexpr std::size_t kMargin = 8;
  std::size_t size = kMargin;
  int omitted = m.omitted;
  for (const RoleStatus& role : m.roles) {
    wire::RoleStatus one;
    Write(role, one);
    const std::size_t added = one.ByteSizeLong() + kMargin;
    if (w.roles_size() >= kMaxRoles || size + added > kMaxHeaderBytes) {
      ++omitted;
      continue;
    }
    size += added;
    *w.add_roles() = std::move(one);
  }
  w.set_omitted(static_cast<std::uint32_t>(omitted));
}

template <class Message, class Wire>
Message Read(const Wire& wire);

/// Visits a message's fields and sets them from the wire's message.
template <class Wire>
class FieldReader {
 public:
  explicit FieldReader(const Wire& wire) : wire_(wire) {}

  template <class T, class Access, class Bound>
  void operator()(int, std::string_view, T& value, const Access& access, const Bound&,
                  std::string_view) {
    if constexpr (HasFields<T>) {
      value = Read<T>(access.get(wire_));
    } else if constexpr (kIsMap<T>) {
      const auto& map = access.get(wire_);
      value = T(map.begin(), map.end());
    } else if constexpr (std::is_same_v<T, int>) {
      value = ToInt(access.get(wire_));
    } else if constexpr (std::is_enum_v<T>) {
      value = static_cast<T>(access.get(wire_));
    } else if constexpr (kIsList<T>) {
      value.reserve(static_cast<std::size_t>(access.get(wire_).size()));
      for (const auto& entry : access.get(wire_)) {
        value.push_back(Read<typename T::value_type>(entry));
      }
    } else {
      value = access.get(wire_);
    }
  }

 private:
  const Wire& wire_;
};

template <class Message, class Wire>
Message Read(const Wire& wire) {
  Message message;
  FieldReader<Wire> reader(wire);
  Message::Visit(message, reader);
  return message;
}

template <class Message>
bool ListsFit(std::span<const std::byte> bytes) {
  if constexpr (std::is_same_v<Message, Hello>) return HelloListsFit(bytes);
  if constexpr (std::is_same_v<Message, Report>) return ReportListsFit(bytes);
  if constexpr (std::is_same_v<Message, StatusReply>) return StatusListsFit(bytes);
  return true;
}

template <class Message>
std::optional<Header> ParseAs(std::span<const std::byte> bytes) {
  WireOf<Message> w;
  if (!ListsFit<Message>(bytes) ||
      !w.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return std::nullopt;
  }
  return Read<Message>(w);
}

using Parser = std::optional<Header> (*)(std::span<const std::byte>);

template <std::size_t... kIndex>
constexpr std::array<Parser, sizeof...(kIndex)> MakeParsers(std::index_sequence<kIndex...>) {
  return {&ParseAs<std::variant_alternative_t<kIndex, Header>>...};
}

}  // namespace

void AppendProtobuf(const Header& header, std::string* out) {
  google::protobuf::io::StringOutputStream stream(out);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);  // Otherwise the order of maps varies.
  const bool is_whole = std::visit(
      [&]<class Message>(const Message& message) {
        WireOf<Message> wire;
        Write(message, wire);
        return wire.SerializeToCodedStream(&coded);
      },
      header);
  SLALOM_CHECK(is_whole);
}

std::optional<Header> ParseProtobuf(std::size_t index, std::span<const std::byte> bytes) {
  static constexpr auto kParsers =
      MakeParsers(std::make_index_sequence<std::variant_size_v<Header>>());
  // Bad bytes from a peer get one answer. They must not make protobuf write to standard error.
  static const auto replaced = google::protobuf::SetLogHandler(nullptr);
  (void)replaced;
  SLALOM_CHECK_LT(index, kParsers.size());
  return kParsers[index](bytes);
}

}  // namespace slalom::proto
