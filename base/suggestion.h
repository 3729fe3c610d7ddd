#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

/// Suggestions for mistyped names.

namespace slalom::base {

/// Number of letters to add, remove, change or swap with their neighbour to turn `a` into `b`. No
/// letter is touched twice (the "optimal string alignment" distance).
std::size_t EditDistance(std::string_view a, std::string_view b);

/// The first of the `names` that are nearest to `word`. Empty if even these are so far away that
/// something else was meant: more than a third of the word's letters, or one letter of a short
/// word.
std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string_view> names);
std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string> names);

/// "; did you mean 'NAME'?" for the nearest name; empty if there is none.
std::string Suggestion(std::string_view word, std::span<const std::string> names);

}  // namespace slalom::base
