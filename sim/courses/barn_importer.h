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

/// What was imported from a directory of the original data set. A value.
struct BarnImport {
  std::map<int, std::shared_ptr<const Course>> courses;  ///< By the N of world_N.world.
  std::vector<std::string> warnings;  ///< One sentence each: mended files, worlds without a path.
  std::vector<std::string> skipped;   ///< One sentence each: worlds that became no course, and why.
};

/// Makes the course of one world. `path` holds (row, col) cells of the field and may be null.
///
/// Start, goal and bounds are those of the static courses. A world whose obstacles all lie on the
/// lattice gets its difficulty measured along the path. Throws `Error` that names `source` where
/// the path is not one or the course cannot be driven (`WhyUnsolvable`). Requires:
/// world.num_moving_models == 0.
Course MakeImportedCourse(std::string name, const World& world, const IntegerTable* path,
                          const std::string& source);

/// Imports every world_N.world of `directory`, or of its world_files/ where it has none itself, as
/// course "barn-NNN"; its path is sought in path_files/, beside it, and in a path_files/ beside its
/// directory.
///
/// Moving obstacles are played as the files of `motions` say (`ReadMotions`; none: those in
/// `directory`, if there are any), as courses "barn-box-NNN" and "barn-wall-NNN" with the fixed
/// obstacles of their world; where `directory` has no such world, with those of the motions' own
/// files. A world whose motion is not known is skipped.
///
/// Throws `Error` that names file and reason at the first file that cannot be read or made a
/// course, where world and motions differ in the number of moving obstacles, where `motions` holds
/// none, or `directory` neither world nor motions.
BarnImport ImportBarn(const std::filesystem::path& directory,
                      const std::optional<std::filesystem::path>& motions);

/// What `WriteCollection` wrote. A value.
struct WrittenCollection {
  std::vector<std::string> sets;        ///< Names of the set files.
  std::vector<std::string> incomplete;  ///< Sets left out, because a course of theirs is missing.
};

/// Writes a collection for `ResolveCourses`: a set file, its courses in it, for each kind of which
/// there are any ("static", "dynamic-box", "dynamic-wall": all there are) and for each of
/// `SplitNames()` whose courses are all there. Throws `Error` where that fails.
WrittenCollection WriteCollection(const BarnImport& import, const std::filesystem::path& output);

}  // namespace slalom::sim
