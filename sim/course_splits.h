#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace slalom::sim {

/// The paper's sets of static courses, by index in the 300 (original-system.md §7.5), the same for
/// the imported original courses and for generated ones:
///
/// - `static`: all 300;
/// - `static-test`: 50, for final figures only;
/// - `static-train-5`, `-10`, `-50`, `-100`, `-250`: nested; the last is all that are not in
/// static-test;
///
/// the 50 that the BARN Challenge is scored on (original-system.md §8.6):
///
/// - `static-challenge`: 0, 6, ..., 294;
///
/// and two of our own, for choosing settings without a look at static-test:
///
/// - `static-validation`: 40 of static-train-250, every third or fourth that is not in
/// static-train-100, so
///   it is unseen by what trains on static-train-100 or less;
/// - `static-train-210`: static-train-250 without static-validation.
std::span<const std::string_view> StaticSplitNames();

/// The indices of a set in the order of the paper's lists. None: no set has this name.
std::optional<std::vector<int>> StaticSplit(std::string_view name);

}  // namespace slalom::sim
