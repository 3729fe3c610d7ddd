#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/geometry.h"
#include "sim/courses/course.h"
#include "sim/courses/map_file.h"

/// Makes courses of places of one's own: Gazebo worlds and maps of ROS.

namespace slalom::sim {

/// A course that was imported. A value.
struct ImportedCourse {
  Course course;
  std::vector<std::string> remarks;  ///< One sentence each: what of the file is not as it was.
};

/// Makes a course of the world in `path` (`ReadWorld`). Its bounds hold all obstacles, the start
/// and the goal, and 1 m around them.
///
/// Throws `Error` that names file and reason if the world cannot be read, if a plugin drives one of
/// its models, or if the course cannot be driven (`WhyUnsolvable`).
ImportedCourse ImportWorld(std::string name, const std::filesystem::path& path,
                           const base::Pose2& start, base::Vec2 goal_W);

/// What a map's unknown cells, and all that is beyond its edge, count as.
enum class UnknownCells { kOccupied, kFree };

/// Makes a course of the map in `path` (`ReadMap`). Its obstacles are boxes of occupied cells, as
/// few as rectangles that grow from the lower left corner give. Its bounds hold the whole map or,
/// if unknown cells count as occupied, the cells that are known and one around them.
///
/// Throws `Error` that names file and reason if the map cannot be read, if start or goal are
/// outside the map or in a cell that is occupied or counts as occupied, or if the course cannot be
/// driven (`WhyUnsolvable`).
ImportedCourse ImportMap(std::string name, const std::filesystem::path& path,
                         const base::Pose2& start, base::Vec2 goal_W, UnknownCells unknown);

}  // namespace slalom::sim
