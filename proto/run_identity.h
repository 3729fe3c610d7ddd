#pragma once

#include <map>
#include <string>

namespace slalom::proto {

/// The keys on which all processes of a run must agree and that are not at their defaults, with
/// their values as TOML. Printable ASCII.
using RunIdentity = std::map<std::string, std::string>;

/// An identity as lines "KEY = VALUE", which travel with policies, and back. Lines of another form
/// are passed over.
std::string PrintIdentity(const RunIdentity& identity);
RunIdentity ParseIdentity(const std::string& text);
/// Metadata of policies that holds it.
inline constexpr char kIdentityMetadata[] = "run";

/// Names the keys in which two identities differ, with both values: "run.seed is 2, expected 1".
/// Names at most five. Empty if they agree.
std::string DescribeDifference(const RunIdentity& found, const RunIdentity& expected);

}  // namespace slalom::proto
