#pragma once

#include <map>
#include <string>

namespace slalom::proto {

/// The keys on which all processes of a run must agree and that are not at their defaults, with
/// their values as TOML. Printable ASCII.
using RunIdentity = std::map<std::string, std::string>;

/// Names the keys in which two identities differ, with both values: "run.seed is 2, expected 1".
/// Names at most five. Empty if they agree.
std::string DescribeDifference(const RunIdentity& found, const RunIdentity& expected);

}  // namespace slalom::proto
