#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "base/parallel.h"
#include "eval/evaluation.h"
#include "eval/report/report.h"

namespace slalom::cli {

/// An evaluation and where it comes from.
struct ScoredRun {
  eval::Evaluation evaluation;
  eval::Provenance provenance;
};

/// An evaluation that is ready to be driven, as often as one likes. A value, but that its agents
/// may use threads that must outlive it.
struct PreparedRun {
  eval::EvaluationTask task;
  eval::MakeAgent make_agent;
  eval::Provenance provenance;
  std::optional<eval::TrainingOverlap> training_overlap = std::nullopt;  ///< As in `Evaluation`.
};

/// Runs `eval::EvaluateOnCourses`, with its errors, and shows a line of progress on standard error:
/// episodes, rate, time left and the success so far. Returns nothing if it was stopped before the
/// end.
std::optional<ScoredRun> RunScored(const PreparedRun& prepared, base::ParallelFor& parallel,
                                   std::stop_token stop);

/// Writes the reports, the trajectories and a picture of the courses with them (courses.png,
/// courses.svg) into `directory`. Throws `base::Error` if that fails.
void WriteScoredRun(const ScoredRun& run, const std::filesystem::path& directory);

}  // namespace slalom::cli
