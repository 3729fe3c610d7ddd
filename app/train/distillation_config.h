#pragma once

#include "base/config_field.h"

namespace slalom::train {

/// Who teaches a policy that is distilled (learner/distillation.cc): policies from files, or from
/// trainings that come first (app/train/resolved_run.h).
struct DistillationConfig {
  base::TomlAssignments teachers;
  base::TomlAssignments stages;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("teachers", teachers,
      "Policy files that teach, by kinds of fresh courses: `{ static = "
      "\"runs/a/policy.safetensors\" }`. Several kinds may share a file.");
    v("stages", stages,
      "Trainings that come first, whose policies teach the kinds of their own courses.fresh. Each "
      "has a name and the keys in which it differs from this config: `{ walls.courses.fresh = "
      "\"wall\", walls.run.max_steps = 2000000 }`. It learns by td3 from random weights unless "
      "it says otherwise, and has no limit in seconds if the run has none (docs/training.md).");
  }
};

}  // namespace slalom::train
