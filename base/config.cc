#include "base/config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "base/error.h"
#include "base/file.h"
#include "base/name.h"

namespace slalom::config {
namespace {

using base::Error;

constexpr int kMaxBases = 8;

const Field* Find(const FieldList& list, std::string_view key) {
  const auto it = std::find_if(list.fields.begin(), list.fields.end(),
                               [key](const Field& field) { return field.key == key; });
  return it == list.fields.end() ? nullptr : &*it;
}

bool IsSection(const FieldList& list, std::string_view key) {
  return std::any_of(list.sections.begin(), list.sections.end(),
                     [key](const Section& section) { return section.key == key; });
}

/// The key that was meant, of any of the lists.
std::string Suggest(std::span<const FieldList* const> lists, std::string_view key) {
  std::string_view best;
  std::size_t best_distance = key.size() / 2 + 1;
  const auto consider = [&](std::string_view candidate) {
    const std::size_t distance = base::EditDistance(key, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  };
  for (const FieldList* list : lists) {
    for (const Field& field : list->fields) consider(field.key);
    for (const Section& section : list->sections) consider(section.key);
    for (const Tables& tables : list->tables) consider(tables.key);
  }
  // A right name in the wrong section, too.
  const auto last = key.substr(key.rfind('.') + 1);
  for (const FieldList* list : lists) {
    for (const Field& field : list->fields) {
      if (std::string_view(field.key).substr(field.key.rfind('.') + 1) == last) best = field.key;
    }
  }
  return best.empty() ? "see docs/config.md for all keys" : fmt::format("did you mean '{}'?", best);
}

std::string Expected(const Field& field) {
  const std::string range =
      field.range ? fmt::format(" in [{}, {}]", field.range->min, field.range->max) : "";
  const std::string unit = field.unit.empty() ? "" : fmt::format(" {}", field.unit);
  struct Name {
    std::string operator()(bool*) { return "true or false"; }
    std::string operator()(int*) { return "an integer"; }
    std::string operator()(std::int64_t*) { return "an integer"; }
    std::string operator()(double*) { return "a number"; }
    std::string operator()(std::string*) { return "a string"; }
    std::string operator()(std::vector<int>*) { return "a list of integers"; }
    std::string operator()(std::vector<double>*) { return "a list of numbers"; }
    std::string operator()(std::vector<std::string>*) { return "a list of strings"; }
    std::string operator()(std::vector<base::TomlValue>*) { return "a list"; }
    std::string operator()(base::TomlAssignments*) { return "a table of keys and values"; }
    std::string operator()(const EnumField&) { return "a name"; }
  };
  if (!field.choices.empty()) return fmt::format("one of '{}'", fmt::join(field.choices, "', '"));
  return std::visit(Name{}, field.value) + range + unit;
}

std::string Where(std::string_view source, const toml::node& node) {
  return fmt::format("{}:{}", source, node.source().begin.line);
}

/// As TOML on one line, numbers with as many digits as they need.
std::string PrintNode(const toml::node& node) {
  if (const toml::array* array = node.as_array()) {
    std::vector<std::string> texts;
    for (const toml::node& element : *array) texts.push_back(PrintNode(element));
    return fmt::format("[{}]", fmt::join(texts, ", "));
  }
  if (auto number = node.value_exact<double>()) {
    return PrintValue(
        {.key = "", .value = &*number, .range = {}, .choices = {}, .unit = "", .meaning = ""});
  }
  std::ostringstream text;
  node.visit([&text](const auto& n) { text << n; });
  return text.str();
}

/// Puts a TOML node into a field. Throws `Error` with `where` and what was expected. `source`: the
/// file of the node; empty if it is from a command line.
class Assign {
 public:
  Assign(const Field& field, const toml::node& node, std::string_view source,
         std::string_view where)
      : field_(field), node_(node), source_(source), where_(where) {}

  void operator()(bool* target) { *target = Value<bool>(node_); }
  void operator()(int* target) { *target = static_cast<int>(Integer(node_, INT32_MIN, INT32_MAX)); }
  void operator()(std::int64_t* target) { *target = Integer(node_, INT64_MIN, INT64_MAX); }
  void operator()(double* target) { *target = Number(node_); }
  void operator()(std::string* target) {
    std::string text = Value<std::string>(node_);
    if (!field_.choices.empty() &&
        std::find(field_.choices.begin(), field_.choices.end(), text) == field_.choices.end()) {
      Fail();
    }
    *target = std::move(text);
  }
  void operator()(std::vector<int>* target) {
    std::vector<int> list;
    for (const toml::node& node : Array()) {
      list.push_back(static_cast<int>(Integer(node, INT32_MIN, INT32_MAX)));
    }
    *target = std::move(list);
  }
  void operator()(std::vector<double>* target) {
    std::vector<double> list;
    for (const toml::node& node : Array()) list.push_back(Number(node));
    *target = std::move(list);
  }
  void operator()(std::vector<std::string>* target) {
    std::vector<std::string> list;
    // One that begins like a list was meant for one, but was no TOML.
    if (const auto text = node_.value<std::string_view>(); text && !text->starts_with('[')) {
      *target = {Value<std::string>(node_)};
      return;
    }
    for (const toml::node& node : Array()) list.push_back(Value<std::string>(node));
    *target = std::move(list);
  }
  void operator()(std::vector<base::TomlValue>* target) {
    std::vector<base::TomlValue> list;
    for (const toml::node& node : Array()) list.push_back(Keep(node));
    *target = std::move(list);
  }
  void operator()(base::TomlAssignments* target) {
    if (!node_.is_table()) Fail();
    if (node_.as_table()->empty()) target->clear();
    Flatten(*node_.as_table(), "", *target);
  }
  void operator()(const EnumField& target) {
    if (!target.set(Value<std::string>(node_))) Fail();
  }
  /// Sets one entry to the node.
  void SetEntry(const std::string& key, base::TomlAssignments& target) const {
    SetEntry(key, node_, target);
  }

 private:
  [[noreturn]] void Fail() const {
    throw Error("{}: {} is {}, expected {}", where_, field_.key, PrintNode(node_),
                Expected(field_));
  }
  base::TomlValue Keep(const toml::node& node) const {
    return {PrintNode(node), source_.empty() ? std::string(where_) : Where(source_, node)};
  }
  void SetEntry(const std::string& key, const toml::node& node,
                base::TomlAssignments& target) const {
    const auto at = std::ranges::lower_bound(target, key, {}, &base::TomlAssignment::key);
    if (at != target.end() && at->key == key) {
      at->value = Keep(node);
    } else {
      target.insert(at, {key, Keep(node)});
    }
  }
  void Flatten(const toml::table& table, const std::string& prefix,
               base::TomlAssignments& target) const {
    for (const auto& [name, node] : table) {
      const std::string key = prefix + std::string(name.str());
      if (node.is_table()) {
        Flatten(*node.as_table(), key + ".", target);
        continue;
      }
      SetEntry(key, node, target);
    }
  }
  template <class T>
  T Value(const toml::node& node) const {
    const auto value = node.value_exact<T>();
    if (!value) Fail();
    return *value;
  }
  void CheckRange(double value) const {
    if (field_.range && !(value >= field_.range->min && value <= field_.range->max)) Fail();
  }
  std::int64_t Integer(const toml::node& node, std::int64_t min, std::int64_t max) const {
    const auto value = Value<std::int64_t>(node);
    if (value < min || value > max) Fail();
    CheckRange(static_cast<double>(value));
    return value;
  }
  double Number(const toml::node& node) const {
    const auto value =
        node.is_integer() ? static_cast<double>(Value<std::int64_t>(node)) : Value<double>(node);
    if (!std::isfinite(value)) Fail();
    CheckRange(value);
    return value;
  }
  const toml::array& Array() const {
    if (!node_.is_array()) Fail();
    return *node_.as_array();
  }

  const Field& field_;
  const toml::node& node_;
  const std::string_view source_;
  const std::string_view where_;
};

/// The fields that the keys of a file may set.
struct Readers {
  const FieldList& list;
  const FieldList* others = nullptr;                ///< Keys that are checked and passed over.
  std::vector<std::string>* passed_over = nullptr;  ///< Names as `ReadSharedTomlFile` returns them.

  bool IsSection(std::string_view key) const {
    return config::IsSection(list, key) || (others != nullptr && config::IsSection(*others, key));
  }
  /// Returns the field of a key, or null if there is none.
  const Field* Find(std::string_view key) const {
    const Field* field = config::Find(list, key);
    if (field != nullptr || others == nullptr) return field;
    field = config::Find(*others, key);
    if (field != nullptr) Note(std::string(key));
    return field;
  }
  std::string Suggest(std::string_view key) const {
    const FieldList* const lists[] = {&list, others};
    return config::Suggest(std::span(lists, others == nullptr ? 1 : 2), key);
  }

 private:
  void Note(std::string name) const {
    const std::string section = name.substr(0, name.find('.'));
    if (!config::IsSection(list, section)) name = section;
    const bool is_new = std::ranges::find(*passed_over, name) == passed_over->end();
    if (is_new) passed_over->push_back(std::move(name));
  }
};

void ReadTable(const toml::table& table, const std::string& prefix, std::string_view source,
               const Readers& readers);

/// Reads an array of tables, `[[key]]`.
void ReadTables(const toml::node& node, const Tables& tables, const std::string& where,
                std::string_view source) {
  const toml::array* array = node.as_array();
  if (array == nullptr ||
      !std::ranges::all_of(*array, [](const auto& n) { return n.is_table(); })) {
    throw Error("{}: {} must be written as tables, [[{}]]", where, tables.key, tables.key);
  }
  tables.clear();
  for (const toml::node& element : *array) {
    const FieldList fields = tables.add();
    if (const toml::node* base = element.as_table()->get("base"); base && !Find(fields, "base")) {
      throw Error("{}: unknown key 'base'; {}", Where(source, *base),
                  Readers{fields}.Suggest("base"));
    }
    ReadTable(*element.as_table(), "", source, {fields});
  }
}

const Tables* FindTables(const FieldList& list, std::string_view key) {
  const auto it = std::ranges::find(list.tables, key, &Tables::key);
  return it == list.tables.end() ? nullptr : &*it;
}

void ReadTable(const toml::table& table, const std::string& prefix, std::string_view source,
               const Readers& readers) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (key == "base") continue;
    const std::string where = fmt::format(
        "{}:{}", source, name.source().begin ? name.source().begin.line : node.source().begin.line);
    if (node.is_table() && readers.IsSection(key)) {
      ReadTable(*node.as_table(), key + ".", source, readers);
    } else if (const Field* field = readers.Find(key)) {
      std::visit(Assign(*field, node, source, where), field->value);
    } else if (const Tables* tables = FindTables(readers.list, key)) {
      ReadTables(node, *tables, where, source);
    } else if (readers.IsSection(key)) {
      throw Error("{}: '{}' is a section, expected a table [{}]", where, key, key);
    } else {
      throw Error("{}: unknown key '{}'; {}", where, key, readers.Suggest(key));
    }
  }
}

/// Takes out the entries for fields that are set now, whose keys satisfy `is_set`.
template <class IsSet>
void DropEntries(const FieldList& list, const IsSet& is_set) {
  for (const Field& field : list.fields) {
    const auto* entries = std::get_if<base::TomlAssignments*>(&field.value);
    if (entries == nullptr) continue;
    const std::string section = field.key.substr(0, field.key.rfind('.') + 1);
    std::erase_if(**entries, [&](const auto& entry) { return is_set(section + entry.key); });
  }
}

bool HasNode(const toml::table& table, std::string_view key) {
  const std::size_t dot = key.find('.');
  const toml::node* node = table.get(key.substr(0, dot));
  if (dot == std::string_view::npos || node == nullptr) return node != nullptr;
  return node->is_table() && HasNode(*node->as_table(), key.substr(dot + 1));
}

/// Reads a whole file, whose values override earlier ones.
void ReadLayer(const toml::table& table, std::string_view source, const Readers& readers) {
  DropEntries(readers.list, [&](const std::string& key) { return HasNode(table, key); });
  ReadTable(table, "", source, readers);
}

toml::table Parse(std::string_view text, std::string_view source) {
  try {
    return toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    throw Error("{}:{}: not valid TOML: {}", source, error.source().begin.line,
                error.description());
  }
}

/// Path of a file that came with the program, by its path in the repository: in the folder that
/// SLALOM_SHARE names, or in share/slalom beside the folder of an installed program.
std::filesystem::path InShare(const std::filesystem::path& path) {
  if (const char* const share = std::getenv("SLALOM_SHARE")) {
    return std::filesystem::path(share) / path;
  }
  std::error_code ec;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ec);
  return program.parent_path().parent_path() / "share/slalom" / path;
}

/// "; did you mean 'configs/fast.toml'?": the preset, beside the file that is not there or in
/// configs/, whose name is nearest. Empty if none is near.
std::string SuggestFile(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::vector<std::string> files, stems;
  for (const fs::path& directory : {path.parent_path(), fs::path("configs")}) {
    std::error_code ec;
    for (const auto& entry :
         fs::directory_iterator(directory.empty() ? "." : Locate(directory), ec)) {
      if (entry.path().extension() != ".toml") continue;
      files.push_back((directory / entry.path().filename()).string());
      stems.push_back(entry.path().stem().string());
    }
  }
  const auto nearest = base::NearestName(path.stem().string(), stems);
  if (!nearest) return "";
  const auto index = std::ranges::find(stems, *nearest) - stems.begin();
  return fmt::format("; did you mean '{}'?", files[static_cast<std::size_t>(index)]);
}

/// The paths that `base` names: one, or a list.
std::vector<std::string> BasesOf(const toml::node& base, std::string_view source) {
  if (const auto name = base.value_exact<std::string>()) return {*name};
  const toml::array* list = base.as_array();
  const bool is_list = list != nullptr && !list->empty() &&
                       std::ranges::all_of(*list, [](const auto& n) { return n.is_string(); });
  if (!is_list) {
    throw Error("{}: base must be the path of a TOML file, or a list of such paths",
                Where(source, base));
  }
  std::vector<std::string> names;
  for (const toml::node& name : *list) names.push_back(*name.value_exact<std::string>());
  return names;
}

/// The file that `name` stands for as a base in `path`. Throws `Error` that begins with `where`.
std::filesystem::path FindBase(const std::filesystem::path& path, const std::string& name,
                               const std::string& where) {
  std::filesystem::path beside = path.parent_path() / name;
  if (base::Exists(beside)) return beside;
  if (std::filesystem::path shared = InShare(name); base::Exists(shared)) return shared;
  throw Error(
      "{}: base = \"{}\": there is neither {} (a base is relative to the file that names it) nor a "
      "preset of this name{}",
      where, name, beside.string(), SuggestFile(name));
}

void ReadFileWithBases(const std::filesystem::path& path, const Readers& readers, int depth) {
  const std::string source = path.string();
  std::error_code ec;
  if (!std::filesystem::exists(path, ec)) {
    throw Error("{}: there is no such file{}", source, SuggestFile(path));
  }
  const toml::table table = Parse(base::ReadTextFile(path), source);
  if (const toml::node* base = table.get("base")) {
    if (depth >= kMaxBases) {
      throw Error("{}: more than {} base files in a row; do they form a circle?",
                  Where(source, *base), kMaxBases);
    }
    for (const std::string& name : BasesOf(*base, source)) {
      ReadFileWithBases(FindBase(path, name, Where(source, *base)), readers, depth + 1);
    }
  }
  ReadLayer(table, source, readers);
}

/// In the form of `PrintValue`: `PrintNode` puts texts between single quotes.
std::string PrintAsConfig(const toml::node& node) {
  if (const toml::array* array = node.as_array()) {
    std::vector<std::string> texts;
    for (const toml::node& element : *array) texts.push_back(PrintAsConfig(element));
    return fmt::format("[{}]", fmt::join(texts, ", "));
  }
  auto text = node.value_exact<std::string>();
  if (!text) return PrintNode(node);
  return PrintValue(
      {.key = "", .value = &*text, .range = {}, .choices = {}, .unit = "", .meaning = ""});
}

void FlattenTable(const toml::table& table, const std::string& prefix, std::string_view source,
                  base::TomlAssignments& values) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (node.is_table()) {
      FlattenTable(*node.as_table(), key + ".", source, values);
    } else {
      values.push_back({key, {PrintAsConfig(node), Where(source, node)}});
    }
  }
}

/// The field of assignments of which `key` names an entry. Null if there is none.
const Field* FindAssignments(const FieldList& list, std::string_view key) {
  const auto it = std::ranges::find_if(list.fields, [key](const Field& field) {
    return std::holds_alternative<base::TomlAssignments*>(field.value) &&
           key.starts_with(field.key + ".");
  });
  return it == list.fields.end() ? nullptr : &*it;
}

struct Elements {
  std::vector<base::TomlValue> values;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("values", values, "");
  }
};

}  // namespace

std::filesystem::path Locate(const std::filesystem::path& path) {
  std::error_code ec;
  if (path.is_absolute() || std::filesystem::exists(path, ec)) return path;
  std::filesystem::path shared = InShare(path);
  return std::filesystem::exists(shared, ec) ? shared : path;
}

void ReadTomlFile(const std::filesystem::path& path, const FieldList& list) {
  ReadFileWithBases(Locate(path), {list}, 0);
}

std::vector<std::string> ReadSharedTomlFile(const std::filesystem::path& path,
                                            const FieldList& list, const FieldList& others) {
  std::vector<std::string> passed_over;
  ReadFileWithBases(Locate(path), {list, &others, &passed_over}, 0);
  return passed_over;
}

bool HasSection(const std::filesystem::path& path, std::string_view name) {
  const std::filesystem::path file = Locate(path);
  return base::Exists(file) &&
         Parse(base::ReadTextFile(file), path.string()).get_as<toml::table>(name);
}

bool HasKey(const FieldList& list, std::string_view key) {
  return Find(list, key) != nullptr || FindAssignments(list, key) != nullptr;
}

void ReadToml(std::string_view text, std::string_view source, const FieldList& list) {
  ReadLayer(Parse(text, source), source, {list});
}

base::TomlAssignments FlattenToml(std::string_view text, std::string_view source) {
  base::TomlAssignments values;
  FlattenTable(Parse(text, source), "", source, values);
  std::ranges::sort(values, {}, &base::TomlAssignment::key);
  return values;
}

void ApplyOverride(std::string_view assignment, const FieldList& list) {
  const auto equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    throw Error("--set {}: expected KEY=VALUE, for example run.seed=2", assignment);
  }
  SetField(assignment.substr(0, equals), assignment.substr(equals + 1),
           fmt::format("--set {}", assignment), list);
}

void SetField(std::string_view key, std::string_view value, std::string_view where,
              const FieldList& list) {
  const Field* field = Find(list, key);
  const Field* const entries = field == nullptr ? FindAssignments(list, key) : nullptr;
  if (field == nullptr && entries == nullptr) {
    if (IsSection(list, key)) {
      throw Error("{}: '{}' is a section, expected one of its keys: {}.KEY=VALUE", where, key, key);
    }
    throw Error("{}: unknown key '{}'; {}", where, key, Readers{list}.Suggest(key));
  }
  toml::table table;
  try {
    table = toml::parse(fmt::format("value = {}", value));
  } catch (const toml::parse_error&) {
    table.clear();
  }
  if (table.size() != 1) table = toml::table{{"value", value}};  // No TOML, or more than one value.
  const toml::node* node = table.get("value");
  if (entries != nullptr) {
    std::string entry(key.substr(entries->key.size() + 1));
    std::erase_if(entry, [](char c) { return c == '"' || c == '\''; });
    Assign(*entries, *node, "", where)
        .SetEntry(entry, *std::get<base::TomlAssignments*>(entries->value));
    return;
  }
  // A text field takes digits and other bare values as they stand.
  const bool is_text = std::holds_alternative<std::string*>(field->value) ||
                       std::holds_alternative<EnumField>(field->value);
  if (is_text && !node->is_string()) {
    table.insert_or_assign("value", value);
    node = table.get("value");
  }
  DropEntries(list, [&](const std::string& set) { return set == key; });
  std::visit(Assign(*field, *node, "", where), field->value);
}

std::vector<base::TomlValue> ElementsOf(const base::TomlValue& array) {
  Elements elements;
  SetField("values", array.text, array.where, ListFields(elements));
  return elements.values;
}

}  // namespace slalom::config
