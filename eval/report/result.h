#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "env/episode.h"
#include "eval/evaluation.h"
#include "eval/summary.h"
#include "sim/courses/course.h"
#include "sim/courses/episode_file.h"

/// Evaluations that are read back from the files of `WriteReports`, to be compared.

namespace slalom::eval {

/// The report that `slalom evaluate` writes as JSON, in the directory of its output.
inline constexpr char kEvaluationFile[] = "evaluation.json";

/// One episode. A value.
struct ResultEpisode {
  env::Outcome outcome = env::Outcome::kTimeout;
  double time = 0.0;  ///< On the protocol's clock, [s].
  int num_collisions = 0;
};

/// The episodes on one course.
struct ResultCourse {
  std::string name;
  double optimal_time = 0.0;  ///< [s]
  std::vector<ResultEpisode> episodes;
};

/// A randomised field and the values that the episodes had.
struct DrawnField {
  std::string key;                 ///< Below [environment], "robot.command_delay".
  std::string unit;                ///< Empty for names, and for numbers without one.
  std::vector<std::string> names;  ///< Empty for numbers.
  /// [number of courses][episodes]: numbers, or places in `names`.
  std::vector<std::vector<double>> values;
};

/// One evaluation, whole. A value.
struct Result {
  std::string file;   ///< Path of its evaluation.json.
  std::string agent;  ///< Its name in tables.
  std::string kind;   ///< "policy" or "planner".
  std::string source;
  std::vector<std::string> profiles;
  std::string course_set;
  std::string collection;  ///< Empty for the built-in courses.
  std::string commit;
  std::map<std::string, std::string> settings;      ///< Its config, TOML by key. Empty: not known.
  std::optional<TrainingOverlap> training_overlap;  ///< Empty if not known, or for a planner.
  std::string physics = "slalom";                   ///< The physics that moved the robot.
  std::string physics_version;                      ///< Empty if not known.
  std::map<std::string, std::string> protocol;      ///< As JSON texts, by key.
  std::int64_t seed = 0;
  double step = 0.0;          ///< Control step, [s].
  double robot_length = 0.0;  ///< [m]
  double robot_width = 0.0;   ///< [m]
  Figures set;
  std::vector<ResultCourse> courses;
  std::vector<DrawnField> drawn;          ///< Empty if none, or not known (archives of sweeps).
  sim::CourseSet course_set_data;         ///< As driven, in the order of `courses`.
  std::vector<sim::EpisodeTrack> tracks;  ///< Each on one of the courses.

  bool collision_ends() const { return protocol.at("collision_ends") == "true"; }
  /// Whether the agent is a policy: another training could have given another one.
  bool is_trained() const { return kind != "planner"; }
};

/// Reads `path`, a directory that `slalom evaluate --output` wrote or the evaluation.json in it,
/// and the files that it names.
///
/// Throws `base::Error` that names the file and its fault: it is missing, is not JSON (cut short),
/// is not an evaluation or of another version, lacks a key or has one out of range, has statistics
/// that contradict its episodes, or has the courses or tracks of another evaluation.
Result ReadResult(const std::filesystem::path& path);

/// An evaluation.json without the files that it names.
struct ParsedResult {
  Result result;             ///< Without courses' shapes and tracks.
  std::string courses_file;  ///< Both without a directory.
  std::string tracks_file;
};

/// Parses the text of an evaluation.json. Throws like `ReadResult`; errors call the text `source`.
ParsedResult ParseResult(std::string_view text, const std::string& source);

/// Throws `base::Error` that names two files and the first difference between their protocols.
void RequireSameProtocol(std::span<const Result> results);

/// Returns the text of an evaluation.json with only the parts that `ParseResult` reads: a line for
/// each course, a letter for the outcome of each episode, and no path of the machine that made it.
/// The same evaluation gives the same text. Throws like `ParseResult`; errors call the text
/// `source`.
std::string CompactResult(std::string_view text, const std::string& source);

}  // namespace slalom::eval
