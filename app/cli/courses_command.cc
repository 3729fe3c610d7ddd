#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/course_selection.h"
#include "app/cli/output.h"
#include "base/error.h"
#include "base/file.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"
#include "sim/courses/episode_file.h"
#include "sim/pictures/course_render.h"
#include "sim/pictures/course_text.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

void PrintTable(const sim::CourseSet& set) {
  fmt::print("{:<24} {:>9} {:>6} {:>9} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "course", "obstacles",
             "moving", "path [m]", "obstacle", "visibility", "dispersion", "width", "tortuosity");
  for (const auto& course : set.courses) {
    fmt::print("{:<24} {:>9} {:>6} {:>9.2f}", course->name,
               course->circles.size() + course->boxes.size(), course->moving.size(),
               sim::ReferenceLength(*course));
    if (course->difficulty) {
      const sim::Difficulty& d = *course->difficulty;
      fmt::print(" {:>10.2f} {:>10.2f} {:>10.2f} {:>10.2f} {:>10.3f}", d.distance_to_obstacle,
                 d.visibility, d.dispersion, d.characteristic_dimension, d.tortuosity);
    }
    fmt::print("\n");
  }
}

/// "  12 with a warning", or nothing.
std::string RemarkOn(const sim::CourseSet& set) {
  const auto count = std::count_if(set.courses.begin(), set.courses.end(), [](const auto& course) {
    return !sim::CourseWarnings(*course).empty();
  });
  return count == 0 ? "" : fmt::format("  {} with a warning, see `slalom courses show`", count);
}

void AddList(CLI::App& courses) {
  CLI::App* command = courses.add_subcommand("list", "List the course sets that have names");
  auto selection = std::make_shared<CourseSelection>();
  selection->AddSource(*command);
  command->callback([selection] {
    fmt::print("{:<20} {:>8}\n", "set", "courses");
    for (const std::string& name : sim::ListCourseSets(selection->collection_path())) {
      const auto set = sim::ResolveCourses(name, selection->collection_path(), selection->seed);
      fmt::print("{:<20} {:>8}{}\n", name, set.courses.size(), RemarkOn(set));
    }
    fmt::print("Fresh courses, which are in no other set: {}\n", sim::FreshCoursePatterns());
  });
}

void AddShow(CLI::App& courses) {
  CLI::App* command = courses.add_subcommand(
      "show", "Print the courses of a set, or one course as a text picture with its measures");
  auto selection = std::make_shared<CourseSelection>();
  command->add_option("SET", selection->spec, CourseSpecHelp())->required();
  command->add_option("COURSE", selection->names,
                      "Courses to show; without any, a table of the whole set");
  selection->AddSource(*command);
  command->callback([selection] {
    const sim::CourseSet set = selection->Resolve();
    if (selection->names.empty() && set.courses.size() > 1) {
      PrintTable(set);
      PrintCourseWarnings(set.courses);
      return;
    }
    for (const auto& course : set.courses) {
      fmt::print("{}\n{}", sim::DrawText(*course), sim::DescribeText(*course));
      for (const std::string& warning : sim::CourseWarnings(*course)) {
        fmt::print("warning:         {}\n", warning);
      }
      fmt::print("\n");
    }
  });
}

/// The options of `render`.
struct RenderOptions {
  CourseSelection selection;
  std::string output;
  std::optional<std::string> format;
  std::optional<std::string> episodes;
  int num_columns = 10;
  bool force = false;
};

sim::PictureFormat FormatOf(const RenderOptions& options) {
  const std::string extension = fs::path(options.output).extension().string();
  const std::string format = options.format ? "." + *options.format : extension;
  if (format == ".svg") return sim::PictureFormat::kSvg;
  if (format == ".png") return sim::PictureFormat::kPng;
  throw base::Error(
      "{}: the picture's format is not clear; end the name in .svg or .png or give --format",
      options.output);
}

std::map<std::string, std::vector<sim::EpisodeTrack>> ReadTracks(const std::string& file,
                                                                 const sim::CourseSet& set) {
  std::map<std::string, std::vector<sim::EpisodeTrack>> tracks;
  bool is_any_used = false;
  for (sim::EpisodeTrack& track : sim::ReadEpisodes(file)) {
    is_any_used =
        is_any_used || std::any_of(set.courses.begin(), set.courses.end(),
                                   [&](const auto& c) { return c->name == track.course; });
    tracks[track.course].push_back(std::move(track));
  }
  base::ThrowIf(!is_any_used, "{}: holds no episode on a course of {}", file, set.name);
  return tracks;
}

void Render(const RenderOptions& options) {
  const sim::PictureFormat format = FormatOf(options);
  RequireOutputFile(options.output, options.force);
  const sim::CourseSet set = options.selection.Resolve();
  std::map<std::string, std::vector<sim::EpisodeTrack>> tracks;
  if (options.episodes) tracks = ReadTracks(*options.episodes, set);
  std::vector<sim::CourseScene> scenes;
  for (const auto& course : set.courses) scenes.push_back({course.get(), tracks[course->name]});
  base::WriteFileAtomically(options.output,
                            scenes.size() == 1
                                ? sim::RenderCourse(scenes.front(), format)
                                : sim::RenderContactSheet(scenes, options.num_columns, format));
  fmt::print(stderr, "{}: {} course{} drawn\n", options.output, scenes.size(),
             scenes.size() == 1 ? "" : "s");
}

void AddRender(CLI::App& courses) {
  CLI::App* command =
      courses.add_subcommand("render", "Draw one course, or several in a grid, as SVG or PNG");
  auto options = std::make_shared<RenderOptions>();
  command->add_option("--courses", options->selection.spec, CourseSpecHelp())->required();
  command->add_option("--course", options->selection.names,
                      "Draw only this course of the set (repeatable)");
  command->add_option("--output", options->output, "File to write")->required();
  command->add_flag("--force", options->force, kForceHelp);
  command->add_option("--format", options->format, "svg or png [as the output's name ends]")
      ->check(CLI::IsMember({"svg", "png"}));
  command
      ->add_option("--episodes", options->episodes,
                   "File of recorded episodes to draw on the courses: the evaluation-tracks.jsonl "
                   "of an evaluation")
      ->check(CLI::ExistingFile);
  command->add_option("--columns", options->num_columns, "Courses side by side")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  options->selection.AddSource(*command);
  command->callback([options] { Render(*options); });
}

void AddGenerate(CLI::App& courses) {
  CLI::App* command =
      courses.add_subcommand("generate", "Write a set of courses to one course file");
  struct Options {
    CourseSelection selection;
    std::string output;
    bool force = false;
  };
  auto options = std::make_shared<Options>();
  options->selection.spec = "static";
  command->add_option("--courses", options->selection.spec, CourseSpecHelp())
      ->capture_default_str();
  command
      ->add_option("--output", options->output,
                   "Course file to write; its name should end in .courses")
      ->required();
  command->add_flag("--force", options->force, kForceHelp);
  options->selection.AddSource(*command);
  command->callback([options] {
    RequireOutputFile(options->output, options->force);
    sim::CourseSet set = options->selection.Resolve();
    std::ranges::replace_if(
        set.name, [](char c) { return c == ':' || c == '+'; }, '-');
    if (!sim::IsCourseName(set.name)) set.name.clear();  // The file's name is the set's then.
    sim::WriteCourseSet(options->output, set);
    fmt::print(stderr, "{}: {} courses written\n", options->output, set.courses.size());
  });
}

}  // namespace

void AddCoursesCommand(CLI::App& app) {
  CLI::App* courses =
      app.add_subcommand("courses", "List, show, draw, animate, write and import obstacle courses");
  courses->require_subcommand(1);
  AddList(*courses);
  AddShow(*courses);
  AddRender(*courses);
  AddAnimateCommand(*courses);
  AddGenerate(*courses);
  AddImportCommand(*courses);
  // Last, as the commands above would inherit it.
  courses->footer(
      "A course is data: obstacles, start, goal and, if there is one, a reference path "
      "(docs/courses.md). Examples:\n\n"
      "  slalom courses show static-test static-1-250        a text picture and its measures\n"
      "  slalom courses render --courses generated:7:20 --output courses.png\n"
      "  slalom courses animate --courses static-test --course static-1-250 --episodes "
      "out/evaluation-tracks.jsonl --output drive.svg\n"
      "  slalom courses import DIR --motions DIR --output barn   the paper's own courses\n"
      "  slalom courses import map.yaml --start 0 0 0 --goal 5 2 --output office.course");
}

}  // namespace slalom::cli
