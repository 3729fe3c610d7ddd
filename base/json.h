#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

namespace slalom::base {

/// How deep objects and lists of a file may lie in each other: nlohmann's parser takes any depth,
/// and its printer then recurses until the stack ends.
inline constexpr int kMaxJsonDepth = 64;

/// Whether `text`, which need not be JSON, opens no more brackets in each other than that.
bool IsShallowJson(std::string_view text);

/// Parses JSON that somebody else may have written. A text that is none, or nested too deeply,
/// becomes a value of which `is_discarded()` is true.
nlohmann::json ParseJson(std::string_view text);

/// The whole number that `value` is. Throws `nlohmann::json::exception` if it is none: nlohmann's
/// own conversion makes 1 of 1.5, and what it makes of 1e300 is undefined.
template <class Json>
std::int64_t WholeNumber(const Json& value) {
  return value.template get_ref<const std::int64_t&>();
}

}  // namespace slalom::base
