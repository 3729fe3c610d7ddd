#include "tests/proto/protocol_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "base/file.h"
#include "proto/bounds.h"
#include "proto/messages.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

using google::protobuf::FieldDescriptor;

/// "4,096".
std::string Grouped(std::int64_t number) {
  std::string text = fmt::format("{}", number);
  for (int i = static_cast<int>(text.size()) - 3; i > (number < 0 ? 1 : 0); i -= 3) {
    text.insert(static_cast<std::size_t>(i), 1, ',');
  }
  return text;
}

/// The comments on the fields in proto/slalom.proto, by "Message.field".
std::map<std::string, std::string> Meanings() {
  std::istringstream lines(base::ReadFile(SLALOM_SOURCE_DIR "/proto/slalom.proto"));
  const std::regex begin(R"(message (\w+) \{.*)");
  const std::regex field(R"( +[\w<>, ]+ (\w+) = \d+[^/]*; +// (.*))");
  std::map<std::string, std::string> meanings;
  std::smatch match;
  std::string message;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, begin)) message = match[1];
    if (std::regex_match(line, match, field)) meanings[message + "." + match[1].str()] = match[2];
  }
  return meanings;
}

std::string TypeOf(const FieldDescriptor& field) {
  if (field.is_map()) return "map of string to " + TypeOf(*field.message_type()->map_value());
  if (field.type() != FieldDescriptor::TYPE_MESSAGE) return field.type_name();
  return fmt::format("{}`{}`", field.is_repeated() ? "repeated " : "",
                     field.message_type()->name());
}

std::string BoundsOf(const FieldDescriptor& field) {
  const auto low = static_cast<std::int64_t>(field.options().GetExtension(wire::min));
  const auto high = static_cast<std::int64_t>(field.options().GetExtension(wire::max));
  const std::string& other = field.options().GetExtension(wire::at_most);
  if (field.is_map()) {
    const bool has_texts =
        field.message_type()->map_value()->type() == FieldDescriptor::TYPE_STRING;
    return fmt::format("{} at most; keys are names{}", Grouped(high),
                       has_texts ? ", values texts" : "");
  }
  if (field.is_repeated()) return fmt::format("{} at most", Grouped(high));
  switch (field.type()) {
    case FieldDescriptor::TYPE_STRING:
      return IsName(field) ? "name" : "text";
    case FieldDescriptor::TYPE_MESSAGE:
    case FieldDescriptor::TYPE_BOOL:
    case FieldDescriptor::TYPE_UINT64:
      return "";
    default:
      if (!other.empty()) {
        return fmt::format("{} to field {}", low,
                           field.containing_type()->FindFieldByName(other)->number());
      }
      return high > 0 ? fmt::format("{} to {}", Grouped(low), Grouped(high))
                      : fmt::format("{} or more", low);
  }
}

std::string TableOf(const std::vector<FieldRow>& rows) {
  const bool has_bounds =
      std::ranges::any_of(rows, [](const auto& r) { return !r.bounds.empty(); });
  std::string table = has_bounds ? "| field | type | | bounds |\n|---|---|---|---|\n"
                                 : "| field | type | |\n|---|---|---|\n";
  for (const FieldRow& row : rows) {
    table += fmt::format("| {} | {} | {} |", row.number, row.type, row.meaning);
    if (has_bounds) table += row.bounds.empty() ? " |" : fmt::format(" {} |", row.bounds);
    table += '\n';
  }
  return table;
}

std::string TableOfRefusals() {
  std::string table = "| code | | meaning |\n|---|---|---|\n";
  for (const RefusalCode code : kRefusalCodes) {
    const auto [name, meaning] = Describe(code);
    table += fmt::format("| {} | `{}` | {} |\n", static_cast<int>(code), name, meaning);
  }
  return table;
}

/// Replaces the first table after the line `place`, before any other heading.
void ReplaceTable(std::string& page, const std::string& place, const std::string& table) {
  const std::size_t line = page.find("\n" + place + "\n");
  const std::size_t next = page.find("\n#", line + place.size());
  const std::size_t begin = page.find("\n| ", line + 1) + 1;
  if (line == std::string::npos || begin == 0 || begin > next) {
    throw std::runtime_error("docs/protocol.md has no table after the line '" + place + "'");
  }
  std::size_t end = begin;
  while (page.compare(end, 1, "|") == 0) end = page.find('\n', end) + 1;
  page.replace(begin, end - begin, table);
}

}  // namespace

std::vector<MessageRows> AllMessages() {
  const std::map<std::string, std::string> meanings = Meanings();
  std::vector<MessageRows> messages;
  const auto& file = *wire::Hello::descriptor()->file();
  for (int i = 0; i < file.message_type_count(); ++i) {
    const auto& type = *file.message_type(i);
    messages.push_back({type.name(), {}});
    for (int k = 0; k < type.field_count(); ++k) {
      const FieldDescriptor& field = *type.field(k);
      const auto meaning = meanings.find(type.name() + "." + field.name());
      messages.back().fields.push_back({field.number(), TypeOf(field),
                                        meaning == meanings.end() ? "" : meaning->second,
                                        BoundsOf(field)});
    }
  }
  return messages;
}

std::string WithTables(const std::string& page) {
  std::string out = page;
  int number = 0;
  for (const MessageRows& message : AllMessages()) {
    const bool is_part = ++number > static_cast<int>(std::variant_size_v<Header>);
    if (message.fields.empty()) continue;
    ReplaceTable(out,
                 is_part ? fmt::format("Each `{}` holds:", message.name)
                         : fmt::format("### {} {}", number, message.name),
                 TableOf(message.fields));
  }
  ReplaceTable(out, "The codes are:", TableOfRefusals());
  return out;
}

}  // namespace slalom::proto
