#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/course_selection.h"
#include "app/cli/output.h"
#include "base/error.h"
#include "sim/courses/barn_importer.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_importer.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

/// The options of `import`.
struct ImportOptions {
  std::string source;
  std::string output;
  bool force = false;
  // Of the original data set.
  std::optional<std::string> motions;
  bool incomplete = false;
  // Of a world or map.
  std::vector<double> start;  ///< x, y, yaw.
  std::vector<double> goal;   ///< x, y.
  std::optional<std::string> unknown;
};

/// Refuses an option that does not suit what is imported.
void Refuse(bool is_given, const ImportOptions& options, std::string_view option,
            std::string_view suits) {
  if (!is_given) return;
  throw base::Error("{}: {} is for {}", options.source, option, suits);
}

void ImportDataSet(const ImportOptions& options) {
  constexpr std::string_view kFile = "a world or map, expected its file in place of a directory";
  Refuse(!options.start.empty(), options, "--start", kFile);
  Refuse(!options.goal.empty(), options, "--goal", kFile);
  Refuse(options.unknown.has_value(), options, "--unknown", kFile);
  RequireOutputDirectory(options.output, options.force);
  const sim::BarnImport import = sim::ImportBarn(options.source, options.motions);
  for (const std::string& warning : import.warnings) fmt::print(stderr, "warning: {}\n", warning);
  for (const std::string& reason : import.skipped) fmt::print(stderr, "skipped: {}\n", reason);
  std::vector<std::shared_ptr<const sim::Course>> imported;
  for (const auto& [number, course] : import.courses) imported.push_back(course);
  PrintCourseWarnings(imported);
  const sim::WrittenCollection written = sim::WriteCollection(
      import, options.output,
      options.incomplete ? sim::IncompleteKinds::kWrite : sim::IncompleteKinds::kRefuse);
  fmt::print("{}: {} courses; sets {}\n", options.output, import.courses.size(),
             fmt::join(written.sets, ", "));
  if (!written.incomplete.empty()) {
    fmt::print(stderr, "sets not written, because some of their worlds are missing: {}\n",
               fmt::join(written.incomplete, ", "));
  }
  fmt::print(
      "To use them: --set courses.collection={} with `slalom train`, --collection {} with other "
      "commands\n",
      options.output, options.output);
}

void ImportFile(const ImportOptions& options) {
  const std::string extension = fs::path(options.source).extension().string();
  const bool is_map = extension == ".yaml" || extension == ".yml";
  base::ThrowIf(
      !is_map && extension != ".world" && extension != ".sdf",
      "{}: expected a directory, a Gazebo world (.world, .sdf) or the description of a map "
      "(.yaml), which names its image",
      options.source);
  constexpr std::string_view kDataSet = "the original data set, expected its directory";
  Refuse(options.motions.has_value(), options, "--motions", kDataSet);
  Refuse(options.incomplete, options, "--incomplete", kDataSet);
  Refuse(!is_map && options.unknown, options, "--unknown", "a map (.yaml)");
  if (options.start.empty() || options.goal.empty()) {
    throw base::Error("{}: {} is missing, expected --start X Y YAW and --goal X Y", options.source,
                      options.start.empty() ? "--start" : "--goal");
  }
  RequireOutputFile(options.output, options.force);
  const std::string name = fs::path(options.output).stem().string();
  base::ThrowIf(
      !sim::IsCourseName(name),
      "{}: the course cannot be called \"{}\", expected a file whose name has 1 to 100 letters, "
      "digits, '-', '_' or '.'",
      options.output, name);
  const base::Pose2 start{{options.start[0], options.start[1]}, options.start[2]};
  const base::Vec2 goal_W{options.goal[0], options.goal[1]};
  sim::ImportedCourse imported =
      is_map ? sim::ImportMap(name, options.source, start, goal_W,
                              options.unknown == "free" ? sim::UnknownCells::kFree
                                                        : sim::UnknownCells::kOccupied)
             : sim::ImportWorld(name, options.source, start, goal_W);
  for (const std::string& remark : imported.remarks) fmt::print(stderr, "{}\n", remark);
  const auto course = std::make_shared<const sim::Course>(std::move(imported.course));
  sim::WriteCourseSet(options.output, {"", {course}});
  const sim::Bounds& bounds = course->bounds;
  fmt::print("{}: course {}, {} cylinders and {} boxes on {:.1f} x {:.1f} m\n", options.output,
             name, course->circles.size(), course->boxes.size(), bounds.max_W.x - bounds.min_W.x,
             bounds.max_W.y - bounds.min_W.y);
}

}  // namespace

void AddImportCommand(CLI::App& courses) {
  CLI::App* command = courses.add_subcommand(
      "import",
      "Make courses of the original BARN worlds (a directory with world_N.world, "
      "path_files/path_N.npy, dynamic_box.csv and dynamic_wall.csv), or one course of a Gazebo "
      "world or a map of ROS");
  auto options = std::make_shared<ImportOptions>();
  command
      ->add_option("FROM", options->source,
                   "Directory of the original worlds, a world (.world, .sdf) or a map (.yaml)")
      ->required()
      ->check(CLI::ExistingPath);
  command
      ->add_option("--output", options->output,
                   "Directory to write the collection to; of a world or map, the course file, "
                   "whose name should end in .course")
      ->required();
  command->add_flag("--force", options->force, kForceHelp);
  command
      ->add_option("--motions", options->motions,
                   "Directory of dynamic_box.csv and dynamic_wall.csv [FROM, if they are there]")
      ->check(CLI::ExistingDirectory);
  command->add_flag("--incomplete", options->incomplete,
                    "Write sets of the worlds that are there, even if others of their kind are "
                    "missing");
  command
      ->add_option("--start", options->start,
                   "X Y YAW: pose at which the robot starts in the world or map, in m and rad")
      ->expected(3);
  command->add_option("--goal", options->goal, "X Y: goal in the world or map, in m")->expected(2);
  command
      ->add_option("--unknown", options->unknown,
                   "What a map's unknown cells count as: occupied or free [occupied]")
      ->check(CLI::IsMember({"occupied", "free"}));
  command->callback([options] {
    if (fs::is_directory(options->source)) {
      ImportDataSet(*options);
    } else {
      ImportFile(*options);
    }
  });
}

}  // namespace slalom::cli
