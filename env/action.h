#pragma once

#include <iterator>
#include <span>
#include <type_traits>

#include "base/config_field.h"

namespace slalom::env {

/// The command for the robot on a course in one control step. Each part is normalised to [-1, 1].
struct Action {
  float linear = 0.0f;
  float angular = 0.0f;

  friend bool operator==(const Action&, const Action&) = default;
};

/// How many numbers an action on a course has.
inline constexpr int kActionSize = 2;
static_assert(sizeof(Action) == kActionSize * sizeof(float));

/// A view of commands (a vector, span or array of `Action`) as numbers, [B, 2], and the reverse.
template <class Actions>
auto NumbersOf(Actions&& actions) {
  using Number =
      std::conditional_t<std::is_const_v<std::remove_pointer_t<decltype(std::data(actions))>>,
                         const float, float>;
  return std::span<Number>(reinterpret_cast<Number*>(std::data(actions)),
                           std::size(actions) * kActionSize);
}
inline std::span<const Action> AsActions(std::span<const float> numbers) {
  return {reinterpret_cast<const Action*>(numbers.data()), numbers.size() / kActionSize};
}
inline std::span<Action> AsActions(std::span<float> numbers) {
  return {reinterpret_cast<Action*>(numbers.data()), numbers.size() / kActionSize};
}

/// The speeds that an action of +-1 commands (docs/original-system.md, section 1.3).
struct ActionBounds {
  double linear_min = -1.0;
  double linear_max = 2.0;
  double angular_max = 3.14;

  /// The speeds that a normalised action commands, [m/s] and [rad/s].
  double linear_mps(const Action& a) const {
    return linear_min + 0.5 * (static_cast<double>(a.linear) + 1.0) * (linear_max - linear_min);
  }
  double angular_radps(const Action& a) const {
    return static_cast<double>(a.angular) * angular_max;
  }

  /// The action that would command these speeds, beyond [-1, 1] if the bounds do not allow them.
  Action Scale(double linear_mps, double angular_radps) const;
  /// The same, clipped to [-1, 1].
  Action Normalise(double linear_mps, double angular_radps) const;
  /// The action that commands standing still. An episode begins with it as the last action, and as
  /// each one before: what drives outside the simulator has to show its policy the same.
  Action Standstill() const { return Normalise(0.0, 0.0); }

  template <class Visitor>
  void Visit(Visitor& v) {
    v("linear_min", linear_min, base::Range{-5.0, 0.0}, "m/s",
      "Speed commanded by a linear action of -1.");
    v("linear_max", linear_max, base::Range{0.1, 5.0}, "m/s",
      "Speed commanded by a linear action of +1.");
    v("angular_max", angular_max, base::Range{0.1, 10.0}, "rad/s",
      "Turn rate commanded by an angular action of +1; -1 turns right.");
  }
};

}  // namespace slalom::env
