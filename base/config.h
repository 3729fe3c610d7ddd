#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
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
/// overrides, or several in a list, of which a later one overrides an earlier one. Unknown keys,
/// wrong types and values out of range are `base::Error`s that name file, line, key and what was
/// expected.
///
/// A field of `base::TomlAssignments` keeps the entries of earlier files, unless a later one gives
/// it the empty table `{}`. An entry for a field of the section around goes, too, if a later file
/// or override sets that field.

namespace slalom::config {

/// An enum in a config struct, which is read and written by its names.
struct EnumField {
  std::function<std::string_view()> name;
  std::function<bool(std::string_view name)> set;  ///< Returns false if no value has this name.
};

/// `base::ReadIf` with the dotted key of the choice.
struct ReadIf {
  std::string key;
  std::vector<std::string_view> values;
};

/// One field of a config struct, found by walking its `Visit`.
struct Field {
  using Pointer = std::variant<bool*, int*, std::int64_t*, double*, std::string*, std::vector<int>*,
                               std::vector<double>*, std::vector<std::string>*,
                               std::vector<base::TomlValue>*, base::TomlAssignments*, EnumField>;
  std::string key;  ///< Dotted from the root, "lidar.num_beams".
  Pointer value;
  std::optional<base::Range> range;
  std::vector<std::string_view> choices;  ///< Empty for free text.
  std::string_view unit;
  std::string_view meaning;
  std::vector<ReadIf> read_if = {};  ///< It is read if all of these hold.
};

/// A group of fields, for printing and documentation.
struct Section {
  std::string key;  ///< Dotted; empty for the root.
  std::string_view meaning;
  std::optional<ReadIf> read_if = {};
};

struct FieldList;

/// A list of structs, which TOML writes as an array of tables, `[[axis]]`.
struct Tables {
  std::string key;  ///< Dotted.
  std::string_view meaning;
  std::function<void()> clear;
  std::function<FieldList()> add;  ///< Appends an element. Invalidates earlier lists of elements.
  std::function<std::vector<FieldList>()> elements;
};

/// The fields of a config struct in the order of its `Visit`, pointing into the struct.
struct FieldList {
  std::vector<Field> fields;
  std::vector<Section> sections;
  std::vector<Tables> tables;
};

/// The visitor that makes a `FieldList`.
class FieldCollector {
 public:
  explicit FieldCollector(FieldList& list) : list_(list) {}

  template <class T>
  void operator()(std::string_view key, T& value, base::Range range, std::string_view unit,
                  std::string_view meaning, const base::ReadIf& read_if = {}) {
    Add({prefix_ + std::string(key), &value, range, {}, unit, meaning}, read_if);
  }
  void operator()(std::string_view key, std::string& value, const base::OneOf& one_of,
                  std::string_view unit, std::string_view meaning) {
    Add({prefix_ + std::string(key), &value, std::nullopt, one_of.choices, unit, meaning}, {});
  }
  template <class T>
  void operator()(std::string_view key, T& value, std::string_view meaning,
                  const base::ReadIf& read_if = {}) {
    Add({prefix_ + std::string(key), &value, std::nullopt, {}, "", meaning}, read_if);
  }
  template <base::NamedEnum E>
  void operator()(std::string_view key, E& value, std::string_view meaning,
                  const base::ReadIf& read_if = {}) {
    const EnumField field = {
        [&value] { return base::EnumName(value); },
        [&value](std::string_view name) { return base::ParseEnum(name, value); }};
    Add({prefix_ + std::string(key), field, std::nullopt, EnumNames(value).choices, "", meaning},
        read_if);
  }
  template <class Config>
  void Section(std::string_view key, Config& config, std::string_view meaning,
               const base::ReadIf& read_if = {}) {
    const std::string outer = prefix_;
    prefix_ += std::string(key) + ".";
    const std::optional<ReadIf> choice = Dotted(read_if);
    list_.sections.push_back({prefix_.substr(0, prefix_.size() - 1), meaning, choice});
    const std::size_t first = list_.fields.size();
    config.Visit(*this);
    for (Field& field : std::span(list_.fields).subspan(first)) {
      if (choice && field.key != choice->key) field.read_if.insert(field.read_if.begin(), *choice);
    }
    prefix_ = outer;
  }
  template <class Config>
  void Tables(std::string_view key, std::vector<Config>& list, std::string_view meaning);

 private:
  std::optional<ReadIf> Dotted(const base::ReadIf& read_if) const {
    if (read_if.key.empty()) return std::nullopt;
    const bool is_dotted = read_if.key.find('.') != std::string_view::npos;
    return ReadIf{(is_dotted ? "" : prefix_) + std::string(read_if.key), read_if.values};
  }
  void Add(Field field, const base::ReadIf& read_if) {
    if (auto choice = Dotted(read_if)) field.read_if.push_back(*std::move(choice));
    list_.fields.push_back(std::move(field));
  }

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

template <class Config>
void FieldCollector::Tables(std::string_view key, std::vector<Config>& list,
                            std::string_view meaning) {
  list_.tables.push_back({prefix_ + std::string(key), meaning, [&list] { list.clear(); },
                          [&list] { return ListFields(list.emplace_back()); },
                          [&list] {
                            std::vector<FieldList> elements;
                            elements.reserve(list.size());
                            for (Config& element : list) elements.push_back(ListFields(element));
                            return elements;
                          }});
}

/// The path itself or, if it is relative and nothing is there, the path of the file or folder of
/// this name that came with the program ("configs/fast.toml" in /usr/share/slalom).
std::filesystem::path Locate(const std::filesystem::path& path);

/// Reads `path` (and its bases), as `Locate` finds it, into the listed fields. A base is relative
/// to the file that names it, or a file that came with the program. Fields that the file does not
/// name keep their values; an array of tables in the file replaces the earlier one. If there is no
/// such file, the error suggests the most similar name.
void ReadTomlFile(const std::filesystem::path& path, const FieldList& list);

/// Like `ReadTomlFile`, for a file that other commands read, too: keys that only `others` has are
/// checked and put into the fields of `others`, which the caller ignores. Returns the ignored
/// names, each once, in the file's order: the name of a section if `list` has no key of that
/// section, else the key.
std::vector<std::string> ReadSharedTomlFile(const std::filesystem::path& path,
                                            const FieldList& list, const FieldList& others);

/// Returns whether the TOML file itself has this section, its bases aside. A file that is not there
/// has none. Throws `base::Error` if it is no TOML.
[[nodiscard]] bool HasSection(const std::filesystem::path& path, std::string_view name);

/// Returns whether the list has a field with this key, or one of `base::TomlAssignments` of which
/// the key names an entry.
[[nodiscard]] bool HasKey(const FieldList& list, std::string_view key);

/// Reads TOML from a text. Errors call it `source`.
void ReadToml(std::string_view text, std::string_view source, const FieldList& list);

/// Returns every key of a TOML text, sorted, with its value in the form of `PrintValue`. Tables
/// inside are flattened ("learner.gamma"). Errors call the text `source`.
base::TomlAssignments FlattenToml(std::string_view text, std::string_view source);

/// Applies one command-line override "a.b=value". The value is TOML; a bare word is a string. A key
/// below a field of `base::TomlAssignments` sets one entry of it, with or without quotes:
/// `set."learner.gamma"=0.99`.
void ApplyOverride(std::string_view assignment, const FieldList& list);

/// Sets the field of this key to `value`, given as TOML, as `ApplyOverride` does. Errors begin with
/// `where`.
void SetField(std::string_view key, std::string_view value, std::string_view where,
              const FieldList& list);

/// Throws `base::Error` if listed fields differ from those in `defaults`, a list of the same
/// struct, although nothing reads them (`base::ReadIf`). The error names the key of each, its value
/// and the choice with which it is read. A choice that is not listed does not count.
void RequireRead(const FieldList& list, const FieldList& defaults);

/// Gives those fields their defaults: what an earlier version of the program recorded, whose
/// defaults were others, is no choice of the user's.
void ResetUnread(const FieldList& list, const FieldList& defaults);

/// Returns the elements of a TOML array. Errors begin with its `where`.
std::vector<base::TomlValue> ElementsOf(const base::TomlValue& array);

/// Returns the value of a field as TOML.
std::string PrintValue(const Field& field);

/// Returns the listed fields whose values are not those in `defaults`, a list of the same struct,
/// as lines `key = value` in the order of the keys. A digest of this text stays as it is when the
/// struct gets another field or another order.
std::string PrintChanges(const FieldList& list, const FieldList& defaults);

/// Returns all listed fields as TOML that reads back to the same values.
std::string PrintToml(const FieldList& list);

/// Returns the listed fields as a Markdown page: a table per section with key, default, range, unit
/// and meaning.
std::string PrintMarkdown(const FieldList& list);

/// Makes a config struct from the defaults, then an optional file, then `--set` overrides.
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

/// `PrintChanges` against the struct as it is constructed.
template <class Config>
std::string Changes(Config config) {
  Config defaults;
  return PrintChanges(ListFields(config), ListFields(defaults));
}

template <class Config>
Config FromToml(std::string_view text, std::string_view source) {
  Config config;
  ReadToml(text, source, ListFields(config));
  return config;
}

}  // namespace slalom::config
