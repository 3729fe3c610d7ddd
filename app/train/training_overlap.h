#pragma once

#include <optional>

#include "app/train/run_config.h"
#include "eval/evaluation.h"
#include "sim/courses/course.h"

namespace slalom::train {

/// Counts the courses of `scored` that a policy of the config `trained` was trained on, or that its
/// teachers or the policy that it started from were (`learner.from`). Courses and policies are read
/// from `trained.courses.inputs` if they are there. A warning names what can no longer be read, for
/// example because a file was moved. Returns nothing if something cannot, and no course is found in
/// the rest.
std::optional<eval::TrainingOverlap> FindTrainingOverlap(const sim::CourseSet& scored,
                                                         const RunConfig& trained);

}  // namespace slalom::train
