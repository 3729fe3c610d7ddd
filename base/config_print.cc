#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/check.h"
#include "base/config.h"

namespace slalom::config {
namespace {

std::string PrintNumber(double value) {
  std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

/// As a TOML basic string on one line.
std::string Quote(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += {'\\', c};
    } else if (code < 0x20 || code == 0x7f) {
      quoted += fmt::format("\\u{:04X}", code);
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

/// The section that a field belongs to: its key less the last part.
std::string SectionOf(std::string_view key) {
  const auto dot = key.rfind('.');
  return dot == std::string_view::npos ? "" : std::string(key.substr(0, dot));
}

std::string NameOf(std::string_view key) { return std::string(key.substr(key.rfind('.') + 1)); }

}  // namespace

std::string PrintValue(const Field& field) {
  struct Printer {
    std::string operator()(const bool* v) { return *v ? "true" : "false"; }
    std::string operator()(const int* v) { return fmt::format("{}", *v); }
    std::string operator()(const std::int64_t* v) { return fmt::format("{}", *v); }
    std::string operator()(const double* v) { return PrintNumber(*v); }
    std::string operator()(const std::string* v) { return Quote(*v); }
    std::string operator()(const std::vector<int>* v) {
      return fmt::format("[{}]", fmt::join(*v, ", "));
    }
    std::string operator()(const std::vector<double>* v) {
      std::vector<std::string> texts;
      for (const double number : *v) texts.push_back(PrintNumber(number));
      return fmt::format("[{}]", fmt::join(texts, ", "));
    }
    std::string operator()(const std::vector<std::string>* v) {
      std::vector<std::string> texts;
      for (const std::string& text : *v) texts.push_back(Quote(text));
      return fmt::format("[{}]", fmt::join(texts, ", "));
    }
    std::string operator()(const std::vector<base::TomlValue>* v) {
      std::vector<std::string> texts;
      for (const base::TomlValue& value : *v) texts.push_back(value.text);
      return fmt::format("[{}]", fmt::join(texts, ", "));
    }
    std::string operator()(const base::TomlAssignments* v) {
      std::vector<std::string> texts;
      for (const auto& [key, value] : *v) texts.push_back(key + " = " + value.text);
      return texts.empty() ? "{}" : fmt::format("{{ {} }}", fmt::join(texts, ", "));
    }
    std::string operator()(const EnumField& v) { return Quote(v.name()); }
  };
  return std::visit(Printer{}, field.value);
}

std::string PrintChanges(const FieldList& list, const FieldList& defaults) {
  SLALOM_CHECK(list.fields.size() == defaults.fields.size());
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < list.fields.size(); ++i) {
    const std::string value = PrintValue(list.fields[i]);
    if (value == PrintValue(defaults.fields[i])) continue;
    lines.push_back(fmt::format("{} = {}\n", list.fields[i].key, value));
  }
  std::ranges::sort(lines);
  return fmt::format("{}", fmt::join(lines, ""));
}

namespace {

void PrintFields(const FieldList& list, const std::string& section, std::string& text) {
  for (const Field& field : list.fields) {
    if (SectionOf(field.key) != section) continue;
    text += fmt::format("{} = {}\n", NameOf(field.key), PrintValue(field));
  }
}

/// `prefix`: of the keys of tables around this one, "group.".
void PrintTables(const FieldList& list, const std::string& prefix, std::string& text) {
  for (const Tables& tables : list.tables) {
    for (const FieldList& element : tables.elements()) {
      text += fmt::format("\n[[{}{}]]\n", prefix, tables.key);
      PrintFields(element, "", text);
      PrintTables(element, prefix + tables.key + ".", text);
    }
  }
}

/// " Read with `learner.algorithm` = `sac`, `tqc`." `section`: whose keys need no prefix; `list`:
/// the defaults.
std::string DescribeReading(const ReadIf& choice, const std::string& section,
                            const FieldList& list) {
  const std::string key = SectionOf(choice.key) == section ? NameOf(choice.key) : choice.key;
  if (!choice.values.empty()) {
    return fmt::format(" Read with `{}` = `{}`.", key, fmt::join(choice.values, "`, `"));
  }
  const auto at = std::ranges::find(list.fields, choice.key, &Field::key);
  SLALOM_CHECK(at != list.fields.end());
  return fmt::format(" Not read with `{}` = `{}`.", key, PrintValue(*at));
}

void PrintFieldRows(const FieldList& list, const std::string& section, std::string& text) {
  const bool any = std::ranges::any_of(
      list.fields, [&](const Field& field) { return SectionOf(field.key) == section; });
  if (!any) return;
  text += "\n| key | default | range | unit | meaning |\n|---|---|---|---|---|\n";
  for (const Field& field : list.fields) {
    if (SectionOf(field.key) != section) continue;
    std::string range;
    if (field.range) range = fmt::format("{} to {}", field.range->min, field.range->max);
    if (!field.choices.empty()) range = fmt::format("`{}`", fmt::join(field.choices, "`, `"));
    // What holds for all of a section is said there.
    const auto of_section = std::ranges::find(list.sections, section, &Section::key);
    const bool is_said = of_section != list.sections.end() && of_section->read_if &&
                         of_section->read_if->key != field.key;
    std::string meaning(field.meaning);
    for (std::size_t i = is_said ? 1 : 0; i < field.read_if.size(); ++i) {
      meaning += DescribeReading(field.read_if[i], section, list);
    }
    text += fmt::format("| `{}` | `{}` | {} | {} | {} |\n", NameOf(field.key), PrintValue(field),
                        range, field.unit, meaning);
  }
}

void DescribeTables(const FieldList& list, const std::string& prefix, std::string& text) {
  for (const Tables& tables : list.tables) {
    text += fmt::format("\n## `[[{}{}]]`\n\n{}\n", prefix, tables.key, tables.meaning);
    const FieldList element = tables.add();
    PrintFieldRows(element, "", text);
    DescribeTables(element, prefix + tables.key + ".", text);
    tables.clear();
  }
}

}  // namespace

std::string PrintToml(const FieldList& list) {
  std::string text;
  PrintFields(list, "", text);
  for (const Section& section : list.sections) {
    text += fmt::format("\n[{}]\n", section.key);
    PrintFields(list, section.key, text);
  }
  PrintTables(list, "", text);
  return text;
}

std::string PrintMarkdown(const FieldList& list) {
  std::string text;
  const bool has_top_level = std::ranges::any_of(
      list.fields, [](const Field& field) { return SectionOf(field.key).empty(); });
  if (has_top_level) {
    text += "\n## Top level\n\nThese keys stand before the first section.\n";
    PrintFieldRows(list, "", text);
  }
  for (const Section& section : list.sections) {
    text +=
        fmt::format("\n## `[{}]`\n\n{}{}\n", section.key, section.meaning,
                    section.read_if ? DescribeReading(*section.read_if, section.key, list) : "");
    PrintFieldRows(list, section.key, text);
  }
  DescribeTables(list, "", text);
  return text;
}

}  // namespace slalom::config
