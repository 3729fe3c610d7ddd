#pragma once

#include <span>
#include <string>

#include "eval/evaluation.h"
#include "eval/report/report.h"
#include "eval/report/result.h"

/// One agent, driven in several physics in the same episodes: from the same starts, with the same
/// random numbers.

namespace slalom::eval {

/// Converts the evaluation to a `Result`, as if it had been written and read.
Result ResultOf(const Evaluation& evaluation, const Provenance& provenance);

/// Returns a Markdown table of the results with a line for each physics, and one of the differences
/// of the second and each further result to the first, course by course (`CompareInPairs`), both
/// with 95 % intervals.
/// Requires: at least one result, results of one protocol on the same courses.
std::string PhysicsTable(std::span<const Result> results);

/// Returns one JSON object, indented, that ends in a newline: "evaluations", the objects in
/// `reports` (`JsonReport`, as many as there are results), and "differences", as in `PhysicsTable`.
/// Requires the same.
std::string PhysicsJson(std::span<const Result> results, std::span<const std::string> reports);

}  // namespace slalom::eval
