#pragma once

#include "base/config_field.h"

namespace slalom::env {

/// The command of an agent for one control step. Each part is normalised to [-1, 1].
struct Action {
  float linear = 0.0f;
  float angular = 0.0f;

  friend bool operator==(const Action&, const Action&) = default;
};

/// How many numbers an action has.
inline constexpr int kActionSize = 2;

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

  /// The action that commands these speeds, clipped to [-1, 1].
  Action Normalise(double linear_mps, double angular_radps) const;

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
