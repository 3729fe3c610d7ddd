#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "base/parallel.h"
#include "eval/evaluation.h"
#include "eval/report.h"

namespace slalom::cli {

/// An evaluation and where it comes from.
struct ScoredRun {
  eval::Evaluation evaluation;
  eval::Provenance provenance;
};

/// Runs `eval::EvaluateOnCourses`, with its errors, and shows a line of progress on standard error:
/// episodes, rate, time left and the success so far. Returns nothing if it was stopped before the
/// end.
std::optional<ScoredRun> RunScored(const eval::EvaluationTask& task,
                                   const eval::MakeAgent& make_agent, eval::Provenance provenance,
                                   base::ParallelFor& parallel, std::stop_token stop);

/// Writes the reports, the trajectories and a picture of the courses with them (courses.png,
/// courses.svg) into `directory`. Throws `base::Error` if that fails.
void WriteScoredRun(const ScoredRun& run, const std::filesystem::path& directory);

}  // namespace slalom::cli
