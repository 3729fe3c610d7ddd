#pragma once

#include <string>

#include "base/config_field.h"

namespace slalom::eval {

/// The courses and the interval of an evaluator process.
struct EvaluatorServiceConfig {
  std::string courses;
  double interval = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("courses", courses, "Courses on which policies are scored. Empty: courses.test.");
    v("interval", interval, base::Range{0.0, 1e6}, "s",
      "Least time between the starts of two evaluations. 0: the newest policy is scored as soon as "
      "the evaluator is free.");
  }
};

}  // namespace slalom::eval
