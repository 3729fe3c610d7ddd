#pragma once

#include <array>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

/// How a config struct lists its fields. Each struct has one member template
///
///     template <class Visitor>
///     void Visit(Visitor& v) {
///       v("num_beams", num_beams, base::Range{1, 4096}, "", "Beams of a scan.");
///       v("device", device, base::OneOf{"auto", "cpu"}, "", "Where to compute.");
///       v("save_replay", save_replay, "Keep the replay buffer in checkpoints.");
///       v("name", name, "Free text.");
///       v.Section("lidar", lidar, "The range finder.");
///       v.Tables("axis", axes, "One axis each: [[axis]], any number of times.");
///     }
///
/// which gives for each field its key, the field itself, its range or choices (none for bool and
/// free text), its unit and its meaning. From this list config/config.h reads, checks, prints and
/// documents the struct. A field is a bool, int, std::int64_t, double, std::string, a std::vector
/// of int, double, std::string or `TomlValue`, or `TomlAssignments`. What `Tables` takes is a
/// std::vector of structs with a `Visit` of their own.

namespace slalom::base {

/// A TOML value whose type only the reader of the struct knows.
struct TomlValue {
  std::string text;   ///< As TOML: `0.5`, `"static-train-50"`, `[256, 256]`.
  std::string where;  ///< Where it was read, for errors: "plan.toml:7". Empty: nowhere.

  friend bool operator==(const TomlValue& a, const TomlValue& b) { return a.text == b.text; }
};

/// Keys of another config and their values, in the order of the file. Tables inside are flattened:
/// `{learner.gamma = 0.99}` has the key `learner.gamma`.
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

}  // namespace slalom::base
