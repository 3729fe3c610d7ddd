#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/config_field.h"

/// Typed configuration: structs with one field list each (`base/config_field.h`), read from TOML.
///
/// A TOML file may name another as `base = "other.toml"` (relative to itself), whose values it
/// overrides. Unknown keys, wrong types and values out of range are `base::Error`s that name file,
/// line, key and what was expected.

namespace slalom::config {

/// One field of a config struct, found by walking its `Visit`.
struct Field {
  using Pointer = std::variant<bool*, int*, std::int64_t*, double*, std::string*, std::vector<int>*,
                               std::vector<double>*>;
  std::string key;  ///< Dotted from the root, "lidar.num_beams".
  Pointer value;
  std::optional<base::Range> range;
  std::vector<std::string_view> choices;  ///< Empty: free text.
  std::string_view unit;
  std::string_view meaning;
};

/// A group of fields, for printing and documentation.
struct Section {
  std::string key;  ///< Dotted; empty for the root.
  std::string_view meaning;
};

/// The fields of a config struct in the order of its `Visit`, pointing into the struct.
struct FieldList {
  std::vector<Field> fields;
  std::vector<Section> sections;
};

/// The visitor that makes a `FieldList`.
class FieldCollector {
 public:
  explicit FieldCollector(FieldList& list) : list_(list) {}

  template <class T>
  void operator()(std::string_view key, T& value, base::Range range, std::string_view unit,
                  std::string_view meaning) {
    list_.fields.push_back({prefix_ + std::string(key), &value, range, {}, unit, meaning});
  }
  void operator()(std::string_view key, std::string& value, const base::OneOf& one_of,
                  std::string_view unit, std::string_view meaning) {
    list_.fields.push_back(
        {prefix_ + std::string(key), &value, std::nullopt, one_of.choices, unit, meaning});
  }
  template <class T>
  void operator()(std::string_view key, T& value, std::string_view meaning) {
    list_.fields.push_back({prefix_ + std::string(key), &value, std::nullopt, {}, "", meaning});
  }
  template <class Config>
  void Section(std::string_view key, Config& config, std::string_view meaning) {
    const std::string outer = prefix_;
    prefix_ += std::string(key) + ".";
    list_.sections.push_back({prefix_.substr(0, prefix_.size() - 1), meaning});
    config.Visit(*this);
    prefix_ = outer;
  }

 private:
  FieldList& list_;
  std::string prefix_;
};

template <class Config>
FieldList ListFields(Config& config) {
  FieldList list;
  FieldCollector collector(list);
  config.Visit(collector);
  return list;
}

/// Reads `path` (and its bases) into the listed fields; keys that it does not hold keep their
/// values. Where there is no such file, the error names the one that was probably meant.
void ReadTomlFile(const std::filesystem::path& path, const FieldList& list);

/// As above for a file that other programs read, too: keys that `list` lacks and `others` has are
/// checked and put into the fields of `others`, which the caller passes over. Returns what was
/// passed over, each once, in the file's order: sections of which `list` has no key by their names,
/// else keys.
std::vector<std::string> ReadSharedTomlFile(const std::filesystem::path& path,
                                            const FieldList& list, const FieldList& others);

/// Whether a field of this key is listed.
[[nodiscard]] bool HasKey(const FieldList& list, std::string_view key);

/// As above from text; `source` names it in errors.
void ReadToml(std::string_view text, std::string_view source, const FieldList& list);

/// Applies one command-line override "a.b=value". The value is TOML; a bare word is a string.
void ApplyOverride(std::string_view assignment, const FieldList& list);

/// The value of a field as TOML.
std::string PrintValue(const Field& field);

/// The listed fields as TOML, complete, that reads back to the same values.
std::string PrintToml(const FieldList& list);

/// The listed fields as a Markdown page: a table per section with key, default, range, unit,
/// meaning.
std::string PrintMarkdown(const FieldList& list);

/// A config struct from an optional file and `--set` overrides, in this order.
template <class Config>
Config Load(const std::optional<std::filesystem::path>& path,
            std::span<const std::string> overrides) {
  Config config;
  const FieldList list = ListFields(config);
  if (path) ReadTomlFile(*path, list);
  for (const std::string& assignment : overrides) ApplyOverride(assignment, list);
  return config;
}

template <class Config>
std::string ToToml(Config config) {
  return PrintToml(ListFields(config));
}

template <class Config>
Config FromToml(std::string_view text, std::string_view source) {
  Config config;
  ReadToml(text, source, ListFields(config));
  return config;
}

}  // namespace slalom::config
