#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/courses/course.h"
#include "sim/courses/npy_file.h"
#include "sim/courses/world_file.h"

/// Reads the original data set: world_N.world (SDF) and path_N.npy, as published by Xu et al., and
/// the motions that its authors left in compiled plugins, as text (sim/courses/dynamic_importer.h).

namespace slalom::sim {

/// The courses imported from a directory of the original data set. A value.
struct BarnImport {
  std::filesystem::path directory;                       ///< What was imported.
  std::map<int, std::shared_ptr<const Course>> courses;  ///< By the N of world_N.world.
  std::vector<std::string> warnings;  ///< One sentence each: mended files, worlds without a path.
  std::vector<std::string> skipped;   ///< One sentence each: worlds that became no course, and why.
};

/// Makes the course of one world. `path` holds (row, col) cells of the field and may be null.
///
/// Start, goal and bounds are the same as in the static courses. A world whose obstacles all lie on
/// the lattice gets its difficulty measured along the path. Throws `Error` that names `source` if
/// `path` is not a path through the field or the course cannot be driven (`WhyUnsolvable`).
/// Requires: world.moving_model_lines.empty().
Course MakeImportedCourse(std::string name, const World& world, const IntegerTable* path,
                          const std::string& source);

/// Imports every world_N.world of `directory` as course "barn-NNN". If `directory` holds none,
/// imports the worlds of its world_files/. Looks for the path of a world in path_files/, beside the
/// world, and in a path_files/ beside the world's directory.
///
/// Moving obstacles follow the files in `motions` (`ReadMotions`), or the files in `directory` if
/// `motions` is not given. Their courses are "barn-box-NNN" and "barn-wall-NNN", with the fixed
/// obstacles of their world, or of the motions' own files if `directory` has no such world. A world
/// without known motion is skipped.
///
/// Throws `Error` that names file and reason if a file cannot be read or made a course, if a world
/// and its motions differ in the number of moving obstacles, if a world has a number that the data
/// set does not have or lacks the moving obstacles that its number tells, if `motions` holds no
/// motions, or if `directory` holds neither worlds nor motions.
BarnImport ImportBarn(const std::filesystem::path& directory,
                      const std::optional<std::filesystem::path>& motions);

/// The set files that `WriteCollection` wrote. A value.
struct WrittenCollection {
  std::vector<std::string> sets;        ///< Names of the set files.
  std::vector<std::string> incomplete;  ///< Sets left out because one of their courses is missing.
};

/// What `WriteCollection` does with a kind of which some courses are there and others are missing.
enum class IncompleteKinds { kRefuse, kWrite };

/// Writes a collection for `ResolveCourses`: one set file for each of `SplitNames()` whose courses
/// are all there. A set file holds its courses. With `kWrite`, the courses of an incomplete kind
/// make a set of another name, such as "static-2-of-300", whose file says in its second line which
/// worlds it lacks. Throws `Error` that names what is missing if `kRefuse` refuses it, and if a
/// file cannot be written. Nothing is written if a kind is refused.
WrittenCollection WriteCollection(const BarnImport& import, const std::filesystem::path& output,
                                  IncompleteKinds incomplete = IncompleteKinds::kRefuse);

}  // namespace slalom::sim
