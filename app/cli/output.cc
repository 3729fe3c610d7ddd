#include "app/cli/output.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "sim/pictures/course_render.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxPictures = 60;
constexpr int kPictureColumns = 10;

void RequireWritable(const fs::path& path, const fs::path& named) {
  if (::access(path.c_str(), W_OK) == 0) return;
  throw base::Error("{}: cannot be written ({})", named.string(), std::strerror(errno));
}

/// The path itself or the nearest of its parents that is there.
fs::path NearestThere(fs::path path) {
  while (!base::Exists(path) && path.has_relative_path()) {
    path = path.has_parent_path() ? path.parent_path() : ".";
  }
  return path;
}

/// The first by name of the directory's files; empty: it holds none.
std::string FirstFile(const fs::path& directory) {
  std::string first;
  for (const fs::path& path : base::ListDirectory(directory)) {
    std::error_code dangling;  // A link that leads nowhere is no directory.
    if (fs::is_directory(path, dangling)) continue;
    const std::string name = path.filename().string();
    if (first.empty() || name < first) first = name;
  }
  return first;
}

}  // namespace

void RequireOutputFile(const fs::path& path, bool force) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  base::ThrowIf(path == "-", "--output -: expected the name of a file, for example /dev/stdout");
  base::ThrowIf(!path.has_filename() || fs::is_directory(status),
                "{}: is a directory, expected a file", path.string());
  if (base::Exists(path)) {
    RequireWritable(path, path);
    if (force || base::IsStream(path)) return;
    throw base::Error("{}: exists already; choose another --output, or replace it with --force",
                      path.string());
  }
  const fs::path directory = path.has_parent_path() ? path.parent_path() : ".";
  base::ThrowIf(!fs::is_directory(directory, error), "{}: there is no directory {}", path.string(),
                directory.string());
  RequireWritable(directory, path);
}

void RequireOutputDirectory(const fs::path& path, bool force) {
  const fs::path there = NearestThere(path);
  std::error_code error;
  if (!fs::is_directory(there, error)) {
    throw base::Error("{}: {}is not a directory, expected one", path.string(),
                      there == path ? "" : there.string() + " ");
  }
  RequireWritable(there, path);
  if (there != path || force) return;
  const std::string first = FirstFile(path);
  if (first.empty()) return;
  throw base::Error(
      "{}: holds {} already; choose a new directory as --output, or replace files with --force",
      path.string(), first);
}

void WriteScores(const train::Scores& scores, const std::filesystem::path& directory) {
  eval::WriteReports(scores.evaluation, scores.provenance, directory);

  const auto& courses = scores.evaluation.task.courses.courses;
  const std::span<const sim::EpisodeTrack> tracks = scores.evaluation.episodes.tracks;
  // Tracks are ordered by course, so the tracks of one course stand together.
  std::vector<sim::CourseScene> scenes;
  std::size_t begin = 0;
  for (std::size_t course = 0; course < courses.size() && scenes.size() < kMaxPictures; ++course) {
    std::size_t end = begin;
    while (end < tracks.size() && tracks[end].course == courses[course]->name) ++end;
    scenes.push_back({courses[course].get(), tracks.subspan(begin, end - begin)});
    begin = end;
  }
  for (const auto format : {sim::PictureFormat::kPng, sim::PictureFormat::kSvg}) {
    const char* name = format == sim::PictureFormat::kPng ? "courses.png" : "courses.svg";
    base::WriteFileAtomically(directory / name,
                              sim::RenderContactSheet(scenes, kPictureColumns, format));
  }
}

}  // namespace slalom::cli
