#pragma once

#include <string_view>

namespace slalom::cli {

/// "0.1.0 (a1b2c3d4e5f6, Release)": version, commit (with "+" where the tree had changes), build
/// type.
std::string_view Version();

/// The commit alone; "unknown" where the source was no git checkout.
std::string_view Commit();

}  // namespace slalom::cli
