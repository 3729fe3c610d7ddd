#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/config.h"
#include "base/error.h"

namespace slalom::config {
namespace {

/// Why nothing reads a field, given as " with learner.algorithm = "td3", ...". Empty if it is read.
std::string WhyUnread(const Field& field, const FieldList& list, const FieldList& defaults) {
  for (const ReadIf& choice : field.read_if) {
    const auto at = std::ranges::find(list.fields, choice.key, &Field::key);
    if (at == list.fields.end()) continue;
    const std::string chosen = PrintValue(*at);
    if (choice.values.empty()) {
      if (chosen != PrintValue(defaults.fields[at - list.fields.begin()])) continue;
      return fmt::format("with {} = {}, with which nothing reads it", choice.key, chosen);
    }
    std::vector<std::string> values;  // As TOML: names have quotes.
    for (const std::string_view value : choice.values) {
      values.push_back(chosen.starts_with('"') ? fmt::format("\"{}\"", value) : std::string(value));
    }
    if (std::ranges::find(values, chosen) != values.end()) continue;
    return fmt::format("with {} = {}, as it is read with {} alone", choice.key, chosen,
                       fmt::join(values, " or "));
  }
  return "";
}

/// Calls `report` with each field that differs from its default although nothing reads it, its
/// default, and why.
template <class Report>
void ForEachUnread(const FieldList& list, const FieldList& defaults, const Report& report) {
  for (std::size_t i = 0; i < list.fields.size(); ++i) {
    const Field& field = list.fields[i];
    if (field.read_if.empty()) continue;
    const std::string expected = PrintValue(defaults.fields[i]);
    if (PrintValue(field) == expected) continue;
    const std::string why = WhyUnread(field, list, defaults);
    if (!why.empty()) report(field, expected, why);
  }
}

}  // namespace

void RequireRead(const FieldList& list, const FieldList& defaults) {
  std::vector<std::string> faults;
  ForEachUnread(list, defaults,
                [&](const Field& field, const std::string& expected, const std::string& why) {
                  faults.push_back(fmt::format("{} is {}, expected its default {} {}", field.key,
                                               PrintValue(field), expected, why));
                });
  base::ThrowIf(!faults.empty(), "{}", fmt::join(faults, "; "));
}

void ResetUnread(const FieldList& list, const FieldList& defaults) {
  bool is_settled = false;  // A field that is reset may be the choice with which another is read.
  while (!is_settled) {
    is_settled = true;
    ForEachUnread(list, defaults,
                  [&](const Field& field, const std::string& expected, const auto&) {
                    SetField(field.key, expected, field.key, list);
                    is_settled = false;
                  });
  }
}

}  // namespace slalom::config
