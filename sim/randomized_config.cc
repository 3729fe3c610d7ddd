#include "sim/randomized_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/name.h"
#include "base/random.h"

namespace slalom::sim {
namespace {

/// Fields, and sections that end in a dot, that are the same in all episodes, and why.
constexpr std::array<std::pair<std::string_view, std::string_view>, 10> kShared = {{
    {"robot.length", "start poses are checked, and pictures drawn, with one outline"},
    {"robot.width", "start poses are checked, and pictures drawn, with one outline"},
    {"robot.control_rate", "the robots of a batch are stepped together"},
    {"lidar.num_beams", "it is the shape of an observation"},
    {"localisation.decides_arrival", "it is a rule of the episode"},
    {"randomize_share", "it says in how many of them fields are drawn"},
    {"action.", "it is what a policy's actions mean"},
    {"observation.", "it is what a policy's network sees"},
    {"reward.", "a policy learns from one reward"},
    {"episode.", "the rules of an episode are the same for all, in evaluations the protocol's"},
}};

/// The fields on which `CheckConsistent` depends and that may be drawn.
constexpr std::array<std::string_view, 13> kCheckedTogether = {
    "lidar.max_range",  "lidar.min_range",        "robot.centre_of_mass_x",
    "robot.drive",      "robot.centre_of_mass_y", "robot.friction",
    "robot.mass",       "robot.sensor_mass",      "robot.sensor_x",
    "robot.track",      "robot.wheel_base",       "robot.wheel_friction",
    "robot.wheel_width"};

constexpr std::string_view kBooleans[] = {"false", "true"};

/// Reads one entry of `EnvironmentConfig::randomize`.
class EntryReader {
 public:
  /// `fields`: those of a config, below [environment].
  EntryReader(const base::TomlAssignment& entry, const config::FieldList& fields)
      : entry_(entry), fields_(fields) {}

  /// Returns the field of this key.
  const config::Field& Target() const {
    const auto found = std::ranges::find(fields_.fields, entry_.key, &config::Field::key);
    if (found == fields_.fields.end() ||
        std::holds_alternative<base::TomlAssignments*>(found->value)) {
      std::vector<std::string> keys;
      for (const config::Field& field : fields_.fields) keys.push_back(field.key);
      const auto nearest = base::NearestName(entry_.key, keys);
      Fail(fmt::format(
          "there is no field environment.{}; {}", entry_.key,
          nearest ? fmt::format("did you mean '{}'?", *nearest) : "docs/config.md lists them"));
    }
    for (const auto& [name, reason] : kShared) {
      const bool is_shared =
          name.ends_with('.') ? entry_.key.starts_with(name) : entry_.key == name;
      if (is_shared)
        Fail(fmt::format("this field is the same in all episodes, because {}", reason));
    }
    return *found;
  }

  RandomizedField Read(const config::Field& target) const {
    RandomizedField field{.key = entry_.key, .unit = target.unit};
    if (std::holds_alternative<double*>(target.value)) {
      const auto elements = List(target, 2, 2);
      field.low = Number(target, elements[0]);
      field.high = Number(target, elements[1]);
      if (field.low > field.high) Fail(Found() + ", expected the smaller number first");
    } else {
      for (const base::TomlValue& element : List(target, 1, 1000)) {
        field.names.push_back(Name(target, element));
      }
      std::vector<std::string> sorted = field.names;
      std::ranges::sort(sorted);
      if (std::ranges::adjacent_find(sorted) != sorted.end()) {
        Fail(Found() + ", expected each of its values once");
      }
    }
    return field;
  }

  /// Returns the value that the task has if nothing is drawn, as `RandomizedConfig::values` does.
  /// `own`: the field of that task. `share`: of the episodes in which fields are drawn.
  double OwnValue(const RandomizedField& drawn, const config::Field& own, double share) const {
    if (double* const* number = std::get_if<double*>(&own.value)) {
      if (**number >= drawn.low && **number <= drawn.high) return **number;
    } else {
      const auto found = std::ranges::find(drawn.names, NameOf(own));
      if (found != drawn.names.end()) return static_cast<double>(found - drawn.names.begin());
    }
    Fail(
        fmt::format("{}, expected {} among its values, which the field has where it is not drawn, "
                    "as environment.randomize_share is {}",
                    Found(), config::PrintValue(own), share));
  }

 private:
  /// The value of a field that is a name or a boolean.
  static std::string NameOf(const config::Field& field) {
    if (const auto* name = std::get_if<config::EnumField>(&field.value)) {
      return std::string(name->name());
    }
    return std::string(kBooleans[*std::get<bool*>(field.value)]);
  }

  [[noreturn]] void Fail(const std::string& what) const {
    throw base::Error("{}environment.randomize.\"{}\": {}", Where(), entry_.key, what);
  }
  std::string Where() const { return entry_.value.where.empty() ? "" : entry_.value.where + ": "; }
  std::string Found() const { return "found " + entry_.value.text; }

  static std::string Expected(const config::Field& target) {
    if (std::holds_alternative<double*>(target.value)) {
      const std::string unit = target.unit.empty() ? "" : fmt::format(" {}", target.unit);
      return fmt::format("[smallest, largest], two numbers in [{}, {}]{}", target.range->min,
                         target.range->max, unit);
    }
    if (target.choices.empty()) return "a list of true, false or both";
    return fmt::format("a list with any of '{}'", fmt::join(target.choices, "', '"));
  }

  std::vector<base::TomlValue> List(const config::Field& target, std::size_t min_size,
                                    std::size_t max_size) const {
    std::vector<base::TomlValue> elements;
    try {
      elements = config::ElementsOf(entry_.value);
    } catch (const base::Error&) {
      Fail(fmt::format("{}, expected {}", Found(), Expected(target)));
    }
    if (elements.size() < min_size || elements.size() > max_size) {
      Fail(fmt::format("{}, expected {}", Found(), Expected(target)));
    }
    return elements;
  }

  /// Sets the target to the element.
  void SetTarget(const config::Field& target, const base::TomlValue& element) const {
    try {
      config::SetField(target.key, element.text, "", fields_);
    } catch (const base::Error&) {
      Fail(fmt::format("{}, expected {}", Found(), Expected(target)));
    }
  }

  double Number(const config::Field& target, const base::TomlValue& element) const {
    SetTarget(target, element);
    return *std::get<double*>(target.value);
  }

  std::string Name(const config::Field& target, const base::TomlValue& element) const {
    SetTarget(target, element);
    return NameOf(target);
  }

  const base::TomlAssignment& entry_;
  const config::FieldList& fields_;
};

}  // namespace

RandomizedConfig::RandomizedConfig(const EnvironmentConfig& config)
    : config_(config), share_(config.randomize_share) {
  config_.randomize.clear();
  config_.randomize_share = 1.0;
  // Entries are read into a copy, since reading sets fields.
  EnvironmentConfig scratch = config_;
  const config::FieldList scratch_fields = config::ListFields(scratch);
  const config::FieldList own_fields = config::ListFields(config_);
  base::TomlAssignments entries = config.randomize;
  std::ranges::sort(entries, {}, &base::TomlAssignment::key);
  for (const base::TomlAssignment& entry : entries) {
    const EntryReader reader(entry, scratch_fields);
    fields_.push_back(reader.Read(reader.Target()));
    targets_.push_back(*std::ranges::find(own_fields.fields, entry.key, &config::Field::key));
    if (share_ < 1.0) {
      own_values_.push_back(reader.OwnValue(fields_.back(), targets_.back(), share_));
    }
  }
  values_.resize(fields_.size());
}

bool RandomizedConfig::draws(std::string_view section) const {
  return std::ranges::any_of(fields_, [section](const RandomizedField& field) {
    return field.key.starts_with(section) && field.key[section.size()] == '.';
  });
}

void RandomizedConfig::Draw(std::uint64_t seed) {
  const std::uint64_t own_seed = base::DeriveSeed(seed, "randomize");
  if (share_ < 1.0 && base::Random(base::DeriveSeed(own_seed, "")).Uniform() >= share_) {
    Set(own_values_);
    return;
  }
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const RandomizedField& field = fields_[i];
    base::Random random(base::DeriveSeed(own_seed, field.key));
    values_[i] = field.names.empty() ? random.Uniform(field.low, field.high)
                                     : static_cast<double>(random.UniformInt(field.names.size()));
  }
  Set(values_);
}

void RandomizedConfig::Set(std::span<const double> values) {
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    values_[i] = values[i];
    const config::Field::Pointer& target = targets_[i].value;
    if (double* const* number = std::get_if<double*>(&target)) {
      **number = values[i];
      continue;
    }
    const std::string& name = fields_[i].names[static_cast<std::size_t>(values[i])];
    if (bool* const* flag = std::get_if<bool*>(&target)) {
      **flag = name == kBooleans[1];
    } else {
      std::get<config::EnumField>(target).set(name);
    }
  }
}

void CheckRandomization(const EnvironmentConfig& config) {
  if (config.randomize.empty()) return;
  RandomizedConfig task(config);
  // Each bound of `CheckConsistent` is broken in a corner if it is broken anywhere: its terms rise,
  // fall or bend upwards all the way from one end of a field's range to the other.
  const std::span<const RandomizedField> fields = task.fields();
  std::vector<std::vector<double>> ends;
  for (const RandomizedField& field : fields) {
    std::vector<double>& values = ends.emplace_back();
    const bool counts = std::ranges::find(kCheckedTogether, field.key) != kCheckedTogether.end();
    if (field.names.empty()) {
      values = {field.low, field.high};
    } else {
      for (std::size_t k = 0; k < field.names.size(); ++k) values.push_back(static_cast<double>(k));
    }
    if (!counts) values.resize(1);
  }
  std::vector<std::size_t> corner(fields.size(), 0);
  std::vector<double> values(fields.size());
  for (;;) {
    for (std::size_t i = 0; i < fields.size(); ++i) values[i] = ends[i][corner[i]];
    task.Set(values);
    try {
      CheckConsistent(task.config());
    } catch (const base::Error& error) {
      throw base::Error("environment.randomize: values that contradict each other may be drawn: {}",
                        error.what());
    }
    std::size_t i = 0;
    while (i < fields.size() && ++corner[i] == ends[i].size()) corner[i++] = 0;
    if (i == fields.size()) return;
  }
}

}  // namespace slalom::sim
