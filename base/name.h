#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

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

}  // namespace slalom::base
