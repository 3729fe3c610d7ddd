#pragma once

#include <optional>

#include "eval/training_overlap.h"
#include "sim/course.h"
#include "train/run_config.h"

namespace slalom::cli {

/// How many courses of `scored` are among those of `trained`, by their obstacles. None: the
/// training courses cannot be had any more (a set file was moved), which a warning says.
std::optional<eval::TrainingOverlap> FindTrainingOverlap(const sim::CourseSet& scored,
                                                         const train::CoursesConfig& trained);

/// Warns, before a training, where courses that its policies will be scored on are among its
/// training courses. Throws `base::Error` where these cannot be had.
void WarnOfTrainingOverlap(const sim::CourseSet& scored, const train::CoursesConfig& training);

}  // namespace slalom::cli
