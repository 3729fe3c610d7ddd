#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

/// What somebody who mistyped a name may have meant.

namespace slalom::base {

/// How many letters must be added, taken away, changed or swapped with their neighbour to make `b`
/// of `a`. No letter is touched twice (the "optimal string alignment" distance).
std::size_t EditDistance(std::string_view a, std::string_view b);

/// The first of the `names` that are nearest to `word`. None: even those are so far away that
/// something else was meant, more than a third of the word's letters (of a short word, one letter).
std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string_view> names);
std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string> names);

/// "; did you mean 'NAME'?" for the nearest name; empty where there is none.
std::string Suggestion(std::string_view word, std::span<const std::string> names);

}  // namespace slalom::base
