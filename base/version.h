#pragma once

#include <string_view>

namespace slalom::base {

/// "0.1.0 (a1b2c3d4e5f6, Release)": version, commit (with "+" if the tree had changes), build type.
std::string_view Version();

/// Returns the commit alone; "unknown" if the source was not a git checkout.
std::string_view Commit();

}  // namespace slalom::base
