#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/config.h"
#include "sim/environment_config.h"

namespace slalom::sim {

/// A field of a task that is drawn for each episode. A value.
struct RandomizedField {
  std::string key;                   ///< Below [environment], "robot.command_delay".
  double low = 0.0;                  ///< Of a number: the smallest value,
  double high = 0.0;                 ///< and the largest, in the field's unit.
  std::vector<std::string> names{};  ///< The values in a list, at least one. Empty for a number.
  std::string_view unit;             ///< "s"; empty for a list.
};

/// A task whose randomised fields (`EnvironmentConfig::randomize`) have the values of an episode: a
/// number is uniform between two bounds, a name or a boolean is any of a list with equal
/// probability. In all but a share of the episodes (`randomize_share`) they have the given config's
/// own values.
///
/// A drawn value is a function of the episode's seed, of the field's key and of its bounds or its
/// list alone, bit for bit; whether values are drawn is one of the seed and the share. Different
/// keys are drawn independently. Thread-compatible; neither copied nor moved, as it keeps pointers
/// to its own fields.
class RandomizedConfig {
 public:
  /// Throws `base::Error` that names the entry, what was found and what was expected if an entry is
  /// not for a field of `config`, not of its type or outside its range, or for a field that all
  /// episodes of a batch share. The same if the share is below 1 and a value
  /// of `config` itself is not among those of its entry.
  explicit RandomizedConfig(const EnvironmentConfig& config);
  RandomizedConfig(const RandomizedConfig&) = delete;
  RandomizedConfig& operator=(const RandomizedConfig&) = delete;

  /// In the order of their keys.
  std::span<const RandomizedField> fields() const { return fields_; }
  /// Whether a field of this section, "robot", is drawn.
  bool draws(std::string_view section) const;

  /// Takes the values of the episode with this seed. Allocates nothing.
  void Draw(std::uint64_t seed);

  /// The task with the values drawn last; before that, with the given config's own. Nothing is
  /// random in it.
  const EnvironmentConfig& config() const { return config_; }
  /// The values drawn last, [fields().size()]: numbers, and the places of names in their lists.
  std::span<const double> values() const { return values_; }

  /// Sets the values. Requires: each is one that may be drawn.
  void Set(std::span<const double> values);

 private:
  EnvironmentConfig config_;
  double share_;  // Of the episodes in which fields are drawn.
  std::vector<RandomizedField> fields_;
  std::vector<config::Field> targets_;  // Fields of config_, in the order of fields_.
  std::vector<double> values_;
  std::vector<double> own_values_;  // Those of the given config.
};

/// Throws `base::Error` as the constructor of `RandomizedConfig` does, and if values that may be
/// drawn together contradict each other (`CheckConsistent`).
void CheckRandomization(const EnvironmentConfig& config);

}  // namespace slalom::sim
