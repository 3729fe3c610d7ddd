#pragma once

#include <optional>

#include "app/train/run_config.h"
#include "eval/training_overlap.h"
#include "sim/courses/course.h"

namespace slalom::cli {

/// Counts the courses of `scored` that are also among those of `trained`, comparing their
/// obstacles. Returns nothing, after a warning, if the training courses can no longer be read (for
/// example because a set file was moved).
std::optional<eval::TrainingOverlap> FindTrainingOverlap(const sim::CourseSet& scored,
                                                         const train::CoursesConfig& trained);

/// Warns, before a training, if courses on which its policies will be scored are among its training
/// courses. Throws `base::Error` if these cannot be read.
void WarnOfTrainingOverlap(const sim::CourseSet& scored, const train::CoursesConfig& training);

}  // namespace slalom::cli
