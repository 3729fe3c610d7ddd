#include "sim/courses/course_stream.h"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "base/check.h"
#include "base/random.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/dynamic_generator.h"

namespace slalom::sim {

Course GenerateStreamCourse(FreshCourses kind, std::uint64_t seed, int number) {
  SLALOM_CHECK_GE(number, 0);
  std::string name = fmt::format("stream-{}-{}", seed, number);
  const std::uint64_t own =
      base::DeriveSeed(seed, "stream-course", {static_cast<std::uint64_t>(number)});
  switch (kind) {
    case FreshCourses::kStatic:
      return GenerateCourse(std::move(name), PublishedRecipe(number % kNumRecipes), own);
    case FreshCourses::kBox: {
      const DynamicBoxRecipe recipe;
      base::Random random(base::DeriveSeed(own, "pool"));
      return GenerateBoxCourse(std::move(name), recipe, DrawBoxTrajectories(recipe, random), own);
    }
    case FreshCourses::kWall:
      return GenerateWallCourse(std::move(name), {}, own);
    case FreshCourses::kNone:
      break;
  }
  base::CheckFailed(__FILE__, __LINE__, "no generator");
}

}  // namespace slalom::sim
