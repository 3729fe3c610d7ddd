#include "base/name.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace slalom::base {

std::size_t EditDistance(std::string_view a, std::string_view b) {
  // Row i holds the distances of the first i letters of `a` to the beginnings of `b`.
  std::vector<std::size_t> before_last(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::swap(before_last, last);
    std::swap(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({changed, last[j] + 1, row[j - 1] + 1});
      const bool is_swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (is_swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
  }
  return row[b.size()];
}

std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string_view> names) {
  std::optional<std::string_view> nearest;
  std::size_t limit = std::max<std::size_t>(1, (word.size() + 1) / 3) + 1;
  for (const std::string_view name : names) {
    const std::size_t distance = EditDistance(word, name);
    if (distance >= limit) continue;
    limit = distance;
    nearest = name;
  }
  return nearest;
}

std::optional<std::string_view> NearestName(std::string_view word,
                                            std::span<const std::string> names) {
  return NearestName(word, std::vector<std::string_view>(names.begin(), names.end()));
}

std::string Suggestion(std::string_view word, std::span<const std::string> names) {
  const auto nearest = NearestName(word, names);
  return nearest ? fmt::format("; did you mean '{}'?", *nearest) : "";
}

}  // namespace slalom::base
