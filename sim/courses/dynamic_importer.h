#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/courses/course.h"
#include "sim/courses/course_splits.h"

/// Reads the motions of worlds 300 to 499 of the original data set, which the published world files
/// lack, from text: dynamic_box.csv and dynamic_wall.csv, and their fixed obstacles from
/// dynamic_box_fixed.csv and dynamic_wall_fixed.csv. docs/courses.md gives the columns.

namespace slalom::sim {

/// The obstacles of a world that do not move. A value.
struct FixedObstacles {
  std::vector<Circle> circles;
  std::vector<Box> boxes;
};

/// One file of motions. A value.
struct DynamicMotions {
  CourseKind kind = CourseKind::kDynamicBox;
  std::filesystem::path file;
  std::map<int, std::vector<MovingObstacle>> worlds;  ///< By N of world_N, in the file's order.
  std::optional<FixedObstacles> fixed;  ///< Common to all worlds. Empty without such a file.
};

/// Reads the motions in `directory`. Empty if it holds neither dynamic_box.csv nor
/// dynamic_wall.csv.
///
/// Throws `Error` that names file and line if a file cannot be read, begins with other columns, or
/// has an invalid line: a missing field, a malformed number, a size or period that is not above 0,
/// a world of another kind, a repeated object.
std::vector<DynamicMotions> ReadMotions(const std::filesystem::path& directory);

/// Makes the course of one world with start, goal and bounds of its kind. The bounds are widened if
/// an obstacle reaches beyond them. Throws `Error` that names `source` if the course cannot be
/// driven (`WhyUnsolvable`). Requires: kind is not kStatic.
Course MakeDynamicCourse(std::string name, CourseKind kind, const FixedObstacles& fixed,
                         const std::vector<MovingObstacle>& moving, const std::string& source);

}  // namespace slalom::sim
