#pragma once

#include <filesystem>
#include <string>

#include "eval/evaluation.h"

/// The forms in which an evaluation leaves the program. docs/evaluation.md lists every key and
/// column.

namespace slalom::eval {

/// Where the figures come from, as texts for the JSON report; empty where not known.
struct Provenance {
  std::string policy;      ///< Path of the policy file, or the name of what drove.
  std::string course_set;  ///< The set as it was asked for.
  std::string collection;  ///< The imported collection it is from; empty: built in.
  std::string commit;      ///< Of the program.
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

/// Writes evaluation.json, evaluation-courses.csv, evaluation-episodes.csv and
/// evaluation-tracks.jsonl
/// (`sim::WriteEpisodes`, for pictures) into `directory`, each atomically.
/// Throws `base::Error` where that fails.
void WriteReports(const Evaluation& evaluation, const Provenance& provenance,
                  const std::filesystem::path& directory);

}  // namespace slalom::eval
