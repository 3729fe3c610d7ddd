#include "app/train/training_overlap.h"

#include "base/error.h"
#include "base/log.h"
#include "sim/courses/course_overlap.h"

namespace slalom::cli {
namespace {

eval::TrainingOverlap Count(const sim::CourseSet& scored, const sim::CourseSet& trained,
                            const std::string& trained_on) {
  return {sim::CountSharedCourses(scored, trained), static_cast<int>(scored.courses.size()),
          trained_on};
}

}  // namespace

std::optional<eval::TrainingOverlap> FindTrainingOverlap(const sim::CourseSet& scored,
                                                         const train::CoursesConfig& trained) {
  try {
    return Count(scored, trained.ResolveTrain(), trained.train);
  } catch (const base::Error& error) {
    spdlog::warn("cannot tell whether the policy was trained on these courses: {}", error.what());
    return std::nullopt;
  }
}

void WarnOfTrainingOverlap(const sim::CourseSet& scored, const train::CoursesConfig& training) {
  const eval::TrainingOverlap overlap = Count(scored, training.ResolveTrain(), training.train);
  if (overlap.num_courses == 0) return;
  spdlog::warn("policies will be scored on {}: {}", scored.name, eval::DescribeOverlap(overlap));
}

}  // namespace slalom::cli
