#pragma once

#include <span>
#include <string>
#include <vector>

#include "eval/report/result.h"

/// Which evaluations belong together, and what they are called.

namespace slalom::eval {

/// The results on one list of courses, in the order given.
struct ResultGroup {
  std::string title;                 ///< "static-test", "static-test of barn", ...
  std::vector<std::size_t> results;  ///< Indices.
};

/// An agent and its evaluations, one for each seed that it was trained with.
struct AgentResults {
  std::string label;                 ///< Unique.
  std::vector<std::size_t> results;  ///< Indices, at least one.
};

/// Whether both were driven on the same courses: name of the set, collection, names and shapes of
/// the courses.
[[nodiscard]] bool HaveSameCourses(const Result& a, const Result& b);

/// Groups the results that were driven on the same courses (`HaveSameCourses`). The groups are in
/// the order in which they first appear.
std::vector<ResultGroup> GroupByCourses(std::span<const Result> results);

/// Returns a name for each result that is unique in its group: the agent, the profiles laid over
/// its task, the physics unless it is Slalom's own, and, if that is not unique, the directory or a
/// number.
std::vector<std::string> Labels(std::span<const Result> results);

/// Returns an agent of one result for each result, called as in `Labels`.
std::vector<AgentResults> AgentsOf(std::span<const Result> results);

/// Returns the agents with results in the group, with these results alone.
std::vector<AgentResults> AgentsIn(const ResultGroup& group, std::span<const AgentResults> agents);

/// Returns a sentence with the rules of the result's protocol.
std::string ProtocolSentence(const Result& result);

/// Returns "td3 was trained on 40 of these 50 courses (static-train)." of the result that is called
/// `label`. Empty if it was trained on none, or if that is not known.
std::string OverlapSentence(const Result& result, const std::string& label);

}  // namespace slalom::eval
