#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "base/check.h"

/// How a config struct lists its fields. Each struct has one member template
///
///     template <class Visitor>
///     void Visit(Visitor& v) {
///       v("num_beams", num_beams, base::Range{1, 4096}, "", "Beams of a scan.");
///       v("label", label, base::OneOf{"left", "right"}, "", "What to print.");
///       v("device", device, "Where to compute.");
///       v("save_replay", save_replay, "Keep the replay buffer in checkpoints.");
///       v("name", name, "Free text.");
///       v("sectors", sectors, "Of a scan that is divided.", base::ReadIf{"pooling", {"sectors"}});
///       v.Section("lidar", lidar, "The range finder.");
///       v.Tables("axis", axes, "One axis each: [[axis]], any number of times.");
///     }
///
/// which gives for each field its key, the field itself, its range or choices (none for bool, enum
/// and free text), its unit, its meaning, and the choice without which nothing reads it. From this
/// list base/config.h reads, checks, prints and documents the struct. A field is a bool, int,
/// std::int64_t, double, std::string, a `NamedEnum`, a std::vector of int, double, std::string or
/// `TomlValue`, or `TomlAssignments`. One string stands for a list of one. `Tables` takes a
/// std::vector of structs with a `Visit` of their own.

namespace slalom::base {

/// A TOML value whose type is known only to the reader of the struct.
struct TomlValue {
  std::string text;   ///< As TOML: `0.5`, `"static-train-50"`, `[256, 256]`.
  std::string where;  ///< Its place, for errors: "plan.toml:7". Empty if not read.

  friend bool operator==(const TomlValue& a, const TomlValue& b) { return a.text == b.text; }
};

/// Keys of another config, or of the section around, and their values, sorted by key. Tables inside
/// are flattened: `{learner.gamma = 0.99}` has the key `learner.gamma`.
struct TomlAssignment {
  std::string key;
  TomlValue value;

  friend bool operator==(const TomlAssignment&, const TomlAssignment&) = default;
};
using TomlAssignments = std::vector<TomlAssignment>;

/// The closed interval in which a numeric field, or each element of a list, must lie.
struct Range {
  double min;
  double max;
};

/// The texts that a string field may hold.
struct OneOf {
  OneOf(std::initializer_list<std::string_view> texts) : choices(texts) {}
  std::vector<std::string_view> choices;
};

/// The values of another field, the choice, with which a field is read. With any other value
/// nothing reads the field, and it must have its default (`config::RequireRead`). On a section: all
/// fields inside but the choice itself.
struct ReadIf {
  std::string_view key{};  ///< Of the choice; without a dot, in the same section.
  std::vector<std::string_view> values = {};  ///< Names or TOML. Empty: all but its default.
};

/// An enum whose values have names in files and messages. They are listed once, beside the enum,
/// in the order of its enumerators, which count from 0:
///
///     enum class Device { kAuto, kCpu };
///     inline base::OneOf EnumNames(Device) { return {"auto", "cpu"}; }
template <class E>
concept NamedEnum = std::is_enum_v<E> && requires(E value) {
  { EnumNames(value) } -> std::same_as<OneOf>;
};

/// The name of a value.
template <NamedEnum E>
std::string_view EnumName(E value) {
  const OneOf names = EnumNames(value);
  const auto index = static_cast<std::size_t>(value);
  SLALOM_CHECK(index < names.choices.size());
  return names.choices[index];
}

/// Sets `value` to the one that has this name. Returns false if none has it.
template <NamedEnum E>
bool ParseEnum(std::string_view name, E& value) {
  const OneOf names = EnumNames(E{});
  const auto found = std::ranges::find(names.choices, name);
  if (found == names.choices.end()) return false;
  value = static_cast<E>(found - names.choices.begin());
  return true;
}

}  // namespace slalom::base

namespace slalom::config {

struct FieldList;

/// The fields of a config struct, as base/config.h defines it. A struct of hundreds of fields,
/// which take a compiler ten seconds, is listed by one source file alone: its header has
/// `extern template`.
template <class Config>
FieldList ListFields(Config& config);

}  // namespace slalom::config
