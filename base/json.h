#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
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

/// Takes values out of a JSON object that somebody else may have written. What is missing or not as
/// expected is an `Error` that names the source and the key. Refers to `object`.
class JsonObject {
 public:
  /// `source`: where it was read from, such as a file. `place`: of the object there: "", or
  /// "courses[3].". Throws if it is no object.
  JsonObject(const nlohmann::json& object, std::string source, std::string place = "");

  /// Throws that `what` is `found`, of which it shows the first 60 letters.
  [[noreturn]] void Fail(const std::string& what, const nlohmann::json& found,
                         std::string_view expected) const;

  const nlohmann::json& Get(const std::string& key) const;
  /// Whether the key is there and not null.
  [[nodiscard]] bool HasValue(const std::string& key) const;
  JsonObject Object(const std::string& key) const;
  const nlohmann::json& List(const std::string& key) const;
  /// Element `i` of a list of objects.
  JsonObject Element(const std::string& key, std::size_t i) const;
  std::string Text(const std::string& key) const;
  double Number(const std::string& key, double min, double max) const;
  int Count(const std::string& key) const;

  void RequireNumber(const std::string& what, const nlohmann::json& value, double min,
                     double max) const;
  void RequireCount(const std::string& what, const nlohmann::json& value) const;

  const std::string& source() const { return source_; }
  const std::string& place() const { return place_; }

 private:
  const nlohmann::json& object_;
  const std::string source_;
  const std::string place_;
};

/// The whole number that `value` is. Throws `nlohmann::json::exception` if it is none: nlohmann's
/// own conversion makes 1 of 1.5, and what it makes of 1e300 is undefined.
template <class Json>
std::int64_t WholeNumber(const Json& value) {
  return value.template get_ref<const std::int64_t&>();
}

}  // namespace slalom::base
