#include "tests/proto/protocol_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

namespace slalom::proto {
namespace {

/// "4,096".
std::string Grouped(std::int64_t number) {
  std::string text = fmt::format("{}", number);
  for (int i = static_cast<int>(text.size()) - 3; i > (number < 0 ? 1 : 0); i -= 3) {
    text.insert(static_cast<std::size_t>(i), 1, ',');
  }
  return text;
}

template <class T>
std::string TypeOf() {
  if constexpr (std::is_same_v<T, std::string>) return "string";
  if constexpr (std::is_same_v<T, std::uint64_t>) return "uint64";
  if constexpr (std::is_same_v<T, std::int64_t>) return "int64";
  if constexpr (std::is_same_v<T, int> || std::is_enum_v<T>) return "uint32";
  if constexpr (std::is_same_v<T, double>) return "double";
  if constexpr (std::is_same_v<T, bool>) return "bool";
  if constexpr (HasFields<T>) return fmt::format("`{}`", T::kName);
  if constexpr (requires { typename T::mapped_type; }) {
    return "map of string to " + TypeOf<typename T::mapped_type>();
  } else if constexpr (requires { requires HasFields<typename T::value_type>; }) {
    return "repeated " + TypeOf<typename T::value_type>();
  }
}

class RowMaker {
 public:
  template <class T, class Access, class Bound>
  void operator()(int number, std::string_view name, const T&, const Access&, const Bound& bound,
                  std::string_view meaning) {
    rows_.push_back({number, std::string(name), TypeOf<T>(), std::string(meaning), Say(bound)});
    if constexpr (std::is_same_v<Bound, AtMost> && requires { typename T::mapped_type; }) {
      const bool has_texts = std::is_same_v<typename T::mapped_type, std::string>;
      rows_.back().bounds += has_texts ? "; keys are names, values texts" : "; keys are names";
    }
  }

  std::vector<FieldRow> Take() { return std::move(rows_); }

 private:
  static std::string Say(const Any&) { return ""; }
  static std::string Say(const Related& bound) { return std::string(bound.text); }
  static std::string Say(const In& bound) {
    return fmt::format("{} to {}", Grouped(static_cast<std::int64_t>(bound.low)),
                       Grouped(static_cast<std::int64_t>(bound.high)));
  }
  static std::string Say(const AtLeast& bound) { return fmt::format("{} or more", bound.low); }
  static std::string Say(const Finite&) { return "finite"; }
  static std::string Say(const Name&) { return "name"; }
  static std::string Say(const Text&) { return "text"; }
  static std::string Say(const AtMost& bound) {
    return Grouped(static_cast<std::int64_t>(bound.size)) + " at most";
  }

  std::vector<FieldRow> rows_;
};

template <class Message>
MessageRows RowsOf() {
  RowMaker maker;
  const Message message;
  Message::Visit(message, maker);
  return {std::string(Message::kName), maker.Take()};
}

template <std::size_t... kIndex>
std::vector<MessageRows> RowsOfAll(std::index_sequence<kIndex...>) {
  return {RowsOf<std::variant_alternative_t<kIndex, Header>>()..., RowsOf<RoleStatus>()};
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
  return RowsOfAll(std::make_index_sequence<std::variant_size_v<Header>>());
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
