#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "base/check.h"
#include "base/config_field.h"
#include "env/action.h"

/// The state on a course, the numbers of a frame besides its scan. `kStateFields` lists them once:
/// sizes, scaling, mirroring and descriptions are loops over it.

namespace slalom::env {

/// What a state holds besides goal and last action.
struct StateOptions {
  bool speeds = false;
  bool mounting = false;
  int commands = 1;
  bool tracked = false;
  bool privileged = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("speeds", speeds,
      "Observe the odometry's forward speed and turn rate, too, scaled like the commands that ask "
      "for them.");
    v("mounting", mounting,
      "Observe where the range finder is mounted (environment.lidar.offset_x and .offset_y), too, "
      "so that one policy can drive robots that differ in it.");
    v("commands", commands, base::Range{1, 16}, "",
      "Last commands that are observed. More than one help against a delay.");
    v("tracked", tracked,
      "Observe where the nearest obstacles are that move, and how they move, as far as a tracker "
      "tells it from scans and odometry (docs/safety.md).");
    v("privileged", privileged,
      "Observe what no sensor tells, too: the robot's true speeds, where the nearest moving "
      "obstacles are and how they move, and the drive of the robot that was drawn. For stages that "
      "teach (distillation.stages): such a policy drives in a simulator alone.");
  }

  friend bool operator==(const StateOptions&, const StateOptions&) = default;
};

/// Who knows a field: the robot, the policy that acts, a tracker of what its scans show
/// (env/sensing/obstacle_tracker.h), or the simulator alone (privileged).
enum class StateSource { kSensors, kActions, kTracker, kSimulator };

/// A number of a field. The state holds its value times `scale`, and a mirror, which exchanges left
/// and right, changes its sign if it has a side.
struct StateNumber {
  double scale = 1.0;
  bool has_side = false;
};

/// Items of the same numbers, which stand together in a state.
struct StateField {
  std::string_view name;                  ///< Of an item; the robot's key for it (docs/robot.md).
  std::string_view unit;                  ///< Of the values of an item.
  std::span<const StateNumber> numbers;   ///< Of an item.
  int (*num_items)(const StateOptions&);  ///< 0 if the state does not hold the field.
  std::string_view meaning;               ///< Of what the state holds.
  StateSource source;
  bool as_command = false;  ///< The state holds the action that would command it, not clipped.
};

inline constexpr StateNumber kPair[] = {{1.0}, {1.0, true}};
inline constexpr StateNumber kMounting[] = {{10.0}, {10.0, true}};
inline constexpr StateNumber kObstacle[] = {{1.0 / 5.0}, {1.0 / 5.0, true}, {1.0}, {1.0, true}};
inline constexpr StateNumber kDrive[] = {{10.0}, {10.0},       {10.0},
                                         {10.0}, {1.0 / 20.0}, {1.0 / 25.0}};
inline constexpr int kObservedObstacles = 5;  ///< Zeros if there are fewer.

/// In the order of a state: the goal comes first, privileged fields come last.
inline constexpr StateField kStateFields[] = {
    {"goal", "m, m", kPair, [](auto&) { return 1; },
     "goal x (ahead) and y (to the left) in the robot's frame, in m", StateSource::kSensors},
    {"last action", "", kPair, [](auto&) { return 1; }, "the action of the step before",
     StateSource::kActions},
    {"speeds", "m/s, rad/s", kPair, [](auto& options) -> int { return options.speeds; },
     "forward speed and turn rate, as the action that commands them", StateSource::kSensors, true},
    {"mounting", "m, m", kMounting, [](auto& options) -> int { return options.mounting; },
     "place of the range finder, x and y, in dm", StateSource::kSensors},
    {"earlier action", "", kPair, [](auto& options) { return options.commands - 1; },
     "the actions before, the newest first, at first the same", StateSource::kActions},
    {"tracked obstacle", "m, m, m/s, m/s", kObstacle,
     [](auto& options) { return options.tracked ? kObservedObstacles : 0; },
     "place in 5 m and velocity in m/s of each of the obstacles that are nearest and move, as they "
     "are tracked",
     StateSource::kTracker},
    {"true speeds", "m/s, rad/s", kPair, [](auto& options) -> int { return options.privileged; },
     "the body's forward speed and turn rate, likewise", StateSource::kSimulator, true},
    {"nearest obstacle", "m, m, m/s, m/s", kObstacle,
     [](auto& options) { return options.privileged ? kObservedObstacles : 0; },
     "place in 5 m and velocity in m/s of each of the moving obstacles that are nearest",
     StateSource::kSimulator},
    {"drive", "s, s, 1, 1, m/s^2, rad/s^2", kDrive,
     [](auto& options) -> int { return options.privileged; },
     "delay and jitter of commands, gains less 1, accelerations of the drive, scaled",
     StateSource::kSimulator},
};

static_assert(std::ranges::is_sorted(kStateFields, {}, [](auto& field) {
  return field.source == StateSource::kSimulator;
}));

/// Calls visit(field, number) for each number of a state, in their order.
template <class Visit>
constexpr void ForEachNumber(const StateOptions& options, Visit&& visit) {
  for (const StateField& field : kStateFields) {
    for (int i = field.num_items(options); i > 0; --i) {
      for (const StateNumber& number : field.numbers) visit(field, number);
    }
  }
}

constexpr int StateSize(const StateOptions& options) {
  int size = 0;
  ForEachNumber(options, [&](auto&, auto&) { ++size; });
  return size;
}

inline constexpr int kStateSize = StateSize({});  ///< Goal and last action.
inline constexpr int kPrivilegedSize = StateSize({.privileged = true}) - kStateSize;

/// The field of this name in `kStateFields`.
consteval std::size_t FieldOf(std::string_view name) {
  std::size_t i = 0;
  while (kStateFields[i].name != name) ++i;
  return i;
}

/// Writes states on a course, field by field. `bounds`: the speeds that actions command. Immutable.
class StateWriter {
 public:
  StateWriter(const StateOptions& options, const ActionBounds& bounds) : bounds_(bounds) {
    for (std::size_t i = 0; i < std::size(kStateFields); ++i) {
      ends_[i + 1] = ends_[i] + kStateFields[i].num_items(options) * kStateFields[i].numbers.size();
    }
  }

  /// Writes a field, or nothing if states do not hold it. Requires: a value, in its unit, for each
  /// number of each item.
  template <class Values>
  void Write(std::size_t field, const Values& values, std::span<float> state) const {
    SLALOM_CHECK_EQ(state.size(), ends_.back());
    const std::span<float> place = state.subspan(ends_[field], ends_[field + 1] - ends_[field]);
    if (place.empty()) return;
    SLALOM_CHECK_EQ(std::size(values), place.size());
    const StateField& traits = kStateFields[field];
    for (std::size_t i = 0; i < place.size(); ++i) {
      place[i] = static_cast<float>(traits.numbers[i % traits.numbers.size()].scale * values[i]);
    }
    if (traits.as_command) AsActions(place).front() = bounds_.Scale(values[0], values[1]);
  }

 private:
  ActionBounds bounds_;
  std::array<std::size_t, std::size(kStateFields) + 1> ends_{};  // Behind a 0.
};

}  // namespace slalom::env
