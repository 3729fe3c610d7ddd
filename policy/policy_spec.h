#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "policy/policy.h"

namespace slalom::policy {

/// Prints the spec and version of a policy as the JSON text of its file.
std::string PrintSpec(const PolicySpec& spec, std::int64_t version);

/// Parses that text into `snapshot`. Checks every number that sizes arrays or enters computations
/// against the ranges of a config, because the file is untrusted. Throws `base::Error` that names
/// `source` and the key if one is missing, of another type or out of range.
void ParseSpec(std::string_view text, std::string_view source, PolicySnapshot* snapshot);

/// Throws `base::Error` that names `source` and the first field in which a policy's spec is not the
/// one `expected`.
void RequireSameSpec(const std::string& source, const PolicySpec& spec, const PolicySpec& expected);

}  // namespace slalom::policy
