#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval/evaluation.h"
#include "eval/report/result.h"

/// The forms in which one evaluation leaves the program. docs/evaluation.md lists every key and
/// column.

namespace slalom::eval {

/// The version of evaluation.json and of the files beside it.
inline constexpr int kResultVersion = 2;

/// Driver and sources of the scores, for the JSON report. Fields that are not known are empty.
struct Provenance {
  std::string agent;                    ///< Name of the driver in tables.
  std::string kind;                     ///< "policy" or "planner".
  std::string source;                   ///< Path of the policy file, or the planner's name.
  std::vector<std::string> profiles{};  ///< Files laid over its task.
  std::string course_set;               ///< The set as it was asked for.
  std::string collection{};             ///< The imported collection it is from; empty: built in.
  std::string commit{};                 ///< Commit of the program.
  std::string config{};                 ///< TOML, every key.
};

/// Returns a table for the terminal: the set's statistics with their intervals, then the courses
/// with the most failures, at most `max_courses`.
std::string TextReport(const Evaluation& evaluation, int max_courses = 5);

/// Returns one JSON object, indented, that ends in a newline.
std::string JsonReport(const Evaluation& evaluation, const Provenance& provenance);

/// Returns CSV with one line per course.
std::string CourseCsv(const Evaluation& evaluation);

/// Returns CSV with one line per episode.
std::string EpisodeCsv(const Evaluation& evaluation);

/// Converts the evaluation to a `Result`, as if it had been written and read.
Result ResultOf(const Evaluation& evaluation, const Provenance& provenance);

/// Writes evaluation-courses.csv, evaluation-episodes.csv, evaluation-tracks.jsonl
/// (`sim::WriteEpisodes`), evaluation.courses (`sim::WriteCourseSet`, the courses as they were
/// driven) and, last, evaluation.json into `directory`, each atomically. `ReadResult` reads them
/// back. Throws `base::Error` if a file cannot be written.
void WriteReports(const Evaluation& evaluation, const Provenance& provenance,
                  const std::filesystem::path& directory);

}  // namespace slalom::eval
