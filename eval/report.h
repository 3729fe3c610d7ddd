#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval/evaluation.h"

/// The forms in which one evaluation leaves the program. docs/evaluation.md lists every key and
/// column.

namespace slalom::eval {

/// The version of evaluation.json and what lies beside it. 1 had neither format nor version.
inline constexpr int kResultVersion = 2;

/// What drove and where the figures come from, for the JSON report; empty where not known.
struct Provenance {
  std::string agent;                  ///< What to call it in tables.
  std::string kind;                   ///< "policy" or "planner".
  std::string source;                 ///< Path of the policy file, or the planner's name.
  std::vector<std::string> profiles;  ///< Files laid over its task.
  std::string course_set;             ///< The set as it was asked for.
  std::string collection;             ///< The imported collection it is from; empty: built in.
  std::string commit;                 ///< Of the program.
  std::string config;                 ///< TOML, every key.
};

/// A table for the terminal: the set's figures with their intervals, then the courses that were
/// most often not mastered, at most `max_courses`.
std::string TextReport(const Evaluation& evaluation, int max_courses = 5);

/// One JSON object, indented, ending in a newline.
std::string JsonReport(const Evaluation& evaluation, const Provenance& provenance);

/// One line per course.
std::string CourseCsv(const Evaluation& evaluation);

/// One line per episode.
std::string EpisodeCsv(const Evaluation& evaluation);

/// Writes evaluation-courses.csv, evaluation-episodes.csv, evaluation-tracks.jsonl
/// (`sim::WriteEpisodes`), evaluation.courses (`sim::WriteCourseSet`, the courses as they were
/// driven) and, last, evaluation.json into `directory`, each atomically. `ReadResult` takes them
/// back. Throws `base::Error` where that fails.
void WriteReports(const Evaluation& evaluation, const Provenance& provenance,
                  const std::filesystem::path& directory);

}  // namespace slalom::eval
