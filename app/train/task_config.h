#pragma once

#include <vector>

#include "base/config_field.h"
#include "env/step_shape.h"

namespace slalom::train {

/// An environment of the user's own in the place of a robot on courses, as the processes that learn
/// from it need to know it.
struct TaskConfig {
  int observation_size = 0;
  std::vector<double> action_low;
  std::vector<double> action_high;

  bool is_own() const { return observation_size > 0; }

  template <class Visitor>
  void Visit(Visitor& v) {
    v("observation_size", observation_size, base::Range{0, env::kMaxStateSize}, "",
      "Numbers of an observation of your own environment, whose actors are slalom.Actor in Python "
      "(docs/python.md). 0: a robot on courses.");
    v("action_low", action_low, base::Range{-1e6, 1e6}, "",
      "Lower bound of each number of an action of your own environment. [] for a robot on "
      "courses.",
      base::ReadIf{"observation_size"});
    v("action_high", action_high, base::Range{-1e6, 1e6}, "", "Upper bounds, likewise.",
      base::ReadIf{"observation_size"});
  }
};

}  // namespace slalom::train
