#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

/// Names that users type.

namespace slalom::base {

inline constexpr std::size_t kMaxNameBytes = 128;

/// Whether a text may name a role or a process of the service, or a stage of a run, or be the key
/// of a number that the service reports: 1 to `kMaxNameBytes` letters, digits, '-', '_', '.', ':',
/// '@'.
inline bool IsName(std::string_view name) {
  return !name.empty() && name.size() <= kMaxNameBytes && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-_.:@").find(c) != std::string_view::npos;
  });
}

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
