#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "policy/policy.h"

namespace slalom::policy {

/// The spec and version of a policy as the JSON text that stands in its file.
std::string PrintSpec(const PolicySpec& spec, std::int64_t version);

/// Reads it into `snapshot`. What sizes arrays or is computed with is held to the ranges of a
/// config, so a file's word is not taken for it. Throws `base::Error` that names `source` and the
/// key where one is missing, of another type or out of range.
void ParseSpec(std::string_view text, std::string_view source, PolicySnapshot* snapshot);

/// Throws `base::Error` that names `source` and the first field in which a policy's spec is not the
/// one `expected`.
void RequireSameSpec(const std::string& source, const PolicySpec& spec, const PolicySpec& expected);

}  // namespace slalom::policy
