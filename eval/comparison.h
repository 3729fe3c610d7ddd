#pragma once

#include <span>
#include <string>
#include <vector>

#include "eval/result.h"

/// Several evaluations side by side, as text. docs/evaluation.md lists the columns.

namespace slalom::eval {

/// The results on one list of courses, in the order given.
struct ResultGroup {
  std::string title;                 ///< "static-test", "static-test of barn", ...
  std::vector<std::size_t> results;  ///< Indices.
};

/// Groups of results that were driven on the same courses (name of the set, collection, and the
/// courses themselves), in the order in which they first appear.
std::vector<ResultGroup> GroupByCourses(std::span<const Result> results);

/// A name for each result, unique among those of its group: the agent, the profiles laid over its
/// task, and where that is not enough the directory or a number.
std::vector<std::string> Labels(std::span<const Result> results);

/// The rules of the results' common protocol, a sentence. Requires: at least one.
std::string ProtocolSentence(const Result& result);

/// A table per group, in Markdown, with 95 % intervals, and a note below it on each policy that was
/// trained on courses of the group.
std::string MarkdownComparison(std::span<const Result> results);

/// One line per result, all figures with the ends of their intervals; empty where there is none.
std::string CsvComparison(std::span<const Result> results);

/// A booktabs table per group.
std::string LatexComparison(std::span<const Result> results);

}  // namespace slalom::eval
