#include "proto/bounds.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <unordered_map>

#include "base/name.h"
#include "proto/messages.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

bool IsPrintable(char c) { return c >= ' ' && c <= '~'; }

/// The options of a field in proto/slalom.proto.
struct Bound {
  double min;
  double max;
  const FieldDescriptor* at_most;
  bool is_name;
};

/// Options are read once, as that takes longer than all checks of a message.
const Bound& BoundOf(const FieldDescriptor& field) {
  static const auto kBounds = [] {
    std::unordered_map<const FieldDescriptor*, Bound> bounds;
    const auto add = [&bounds](const Descriptor& type) {
      for (int i = 0; i < type.field_count(); ++i) {
        const auto& options = type.field(i)->options();
        const bool is_key = type.options().map_entry() && type.field(i)->number() == 1;
        bounds[type.field(i)] = {
            .min = options.GetExtension(wire::min),
            .max = options.GetExtension(wire::max),
            .at_most = type.FindFieldByName(options.GetExtension(wire::at_most)),
            .is_name = is_key || options.GetExtension(wire::is_name)};
      }
    };
    const google::protobuf::FileDescriptor& file = *wire::Hello::descriptor()->file();
    for (int i = 0; i < file.message_type_count(); ++i) {
      const Descriptor& type = *file.message_type(i);
      add(type);
      for (int j = 0; j < type.nested_type_count(); ++j) add(*type.nested_type(j));
    }
    return bounds;
  }();
  return kBounds.at(&field);
}

template <class T>
T LargestOf(const FieldDescriptor& field) {
  const double max = BoundOf(field).max;
  return max > 0.0 ? static_cast<T>(max) : std::numeric_limits<T>::max();
}

template <class T>
std::string FaultOfNumber(std::string_view name, T value, T low, T high) {
  if (value >= low && value <= high) return "";  // NaN is not.
  return fmt::format("{} is {}, expected {} to {}", name, value, low, high);
}

template <class T>
std::string FaultOfNumber(const FieldDescriptor& field, T value) {
  return FaultOfNumber(field.name(), value, static_cast<T>(BoundOf(field).min),
                       LargestOf<T>(field));
}

std::string FaultOfString(std::string_view name, std::string_view value, bool is_name) {
  if (is_name && !base::IsName(value)) {
    return fmt::format("{} is '{}', expected 1 to {} letters, digits, '-_.:@'", name,
                       FitText(value.substr(0, base::kMaxNameBytes)), base::kMaxNameBytes);
  }
  if (!is_name && (value.size() > kMaxTextBytes || !std::ranges::all_of(value, IsPrintable))) {
    return fmt::format("{} is not a text of at most {} printable ASCII characters", name,
                       kMaxTextBytes);
  }
  return "";
}

std::int64_t IntegerOf(const Message& m, const FieldDescriptor& field) {
  const bool is_signed = field.cpp_type() == FieldDescriptor::CPPTYPE_INT64;
  return is_signed ? m.GetReflection()->GetInt64(m, &field)
                   : std::int64_t{m.GetReflection()->GetUInt32(m, &field)};
}

/// `name`: of the field in words.
std::string FaultOfField(const Message& m, const FieldDescriptor& field, std::string_view name) {
  const Reflection& fields = *m.GetReflection();
  std::string scratch;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return FindFault(fields.GetMessage(m, &field));
    case FieldDescriptor::CPPTYPE_STRING:
      return FaultOfString(name, fields.GetStringReference(m, &field, &scratch), IsName(field));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return FaultOfNumber(field, fields.GetDouble(m, &field));
    case FieldDescriptor::CPPTYPE_UINT32:
    case FieldDescriptor::CPPTYPE_INT64:
      return FaultOfNumber(field, IntegerOf(m, field));
    default:  // Any bool and any uint64.
      return "";
  }
}

std::string FaultOfEntries(const Message& m, const FieldDescriptor& field) {
  const Reflection& fields = *m.GetReflection();
  const int size = fields.FieldSize(m, &field);
  std::string fault =
      FaultOfNumber(fmt::format("the number of {}", field.name()), size, 0, LargestOf<int>(field));
  const std::string value = fmt::format("a {}", field.name().substr(0, field.name().size() - 1));
  const std::string key = fmt::format("the key of {}", value);
  for (int i = 0; i < size && fault.empty(); ++i) {
    const Message& entry = fields.GetRepeatedMessage(m, &field, i);
    if (!field.is_map()) {
      fault = FindFault(entry);
      continue;
    }
    const FieldDescriptor& mapped = *field.message_type()->map_value();
    fault = FaultOfField(entry, *field.message_type()->map_key(), key);
    const bool is_any = mapped.cpp_type() != FieldDescriptor::CPPTYPE_STRING;
    if (fault.empty() && !is_any) fault = FaultOfField(entry, mapped, value);
  }
  return fault;
}

/// Of bounds that depend on another field.
std::string FaultOfRelation(const Message& m, const FieldDescriptor& field) {
  if (const Bound& bound = BoundOf(field); bound.at_most != nullptr) {
    return FaultOfNumber(field.name(), IntegerOf(m, field), static_cast<std::int64_t>(bound.min),
                         IntegerOf(m, *bound.at_most));
  }
  if (field.name() == "history") {
    const FieldDescriptor& batch = *m.GetDescriptor()->FindFieldByName("batch");
    const std::int64_t frames = IntegerOf(m, batch) * IntegerOf(m, field);
    return FaultOfNumber<std::int64_t>("batch times history", frames, 1, kMaxFrames);
  }
  return "";
}

bool ListsFit(const Descriptor& type, CodedInputStream* in) {
  std::array<double, 16> counts{};  // By the field's place.
  while (const std::uint32_t tag = in->ReadTag()) {
    const auto* field = type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
    if (field == nullptr || field->type() != FieldDescriptor::TYPE_MESSAGE ||
        WireFormatLite::GetTagWireType(tag) != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
      if (!WireFormatLite::SkipField(in, tag)) return true;
      continue;
    }
    const double most = field->is_repeated() ? LargestOf<double>(*field) : 1.0;
    if (++counts.at(static_cast<std::size_t>(field->index())) > most) return false;
    int size = 0;
    if (!in->ReadVarintSizeAsInt(&size)) return true;
    const auto rest = in->PushLimit(size);
    if (field->is_map() ? !in->Skip(size) : !ListsFit(*field->message_type(), in)) return false;
    in->PopLimit(rest);
  }
  return true;
}

}  // namespace

std::string FindFault(const Message& message) {
  const Descriptor& type = *message.GetDescriptor();
  std::string fault;
  for (int i = 0; i < type.field_count() && fault.empty(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    fault = field.is_repeated() ? FaultOfEntries(message, field)
                                : FaultOfField(message, field, field.name());
  }
  for (int i = 0; i < type.field_count() && fault.empty(); ++i) {
    fault = FaultOfRelation(message, *type.field(i));
  }
  return fault;
}

bool ListsFit(const Descriptor& type, std::span<const std::byte> protobuf) {
  CodedInputStream in(reinterpret_cast<const std::uint8_t*>(protobuf.data()),
                      static_cast<int>(protobuf.size()));
  return ListsFit(type, &in);
}

bool IsName(const FieldDescriptor& field) { return BoundOf(field).is_name; }

std::string FitText(std::string_view text) {
  std::string fitting(text.substr(0, kMaxTextBytes));
  std::ranges::replace_if(
      fitting, [](char c) { return !IsPrintable(c); }, '?');
  return fitting;
}

}  // namespace slalom::proto
