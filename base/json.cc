#include "base/json.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"

namespace slalom::base {

bool IsShallowJson(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMaxJsonDepth) return false;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return true;
}

nlohmann::json ParseJson(std::string_view text) {
  if (!IsShallowJson(text)) return nlohmann::json(nlohmann::json::value_t::discarded);
  return nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
}

JsonObject::JsonObject(const nlohmann::json& object, std::string source, std::string place)
    : object_(object), source_(std::move(source)), place_(std::move(place)) {
  if (!object.is_object()) Fail(place_.empty() ? "the file" : place_, object, "an object");
}

void JsonObject::Fail(const std::string& what, const nlohmann::json& found,
                      std::string_view expected) const {
  std::string text = found.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  throw Error("{}: {} is {}, expected {}", source_, what, text, expected);
}

const nlohmann::json& JsonObject::Get(const std::string& key) const {
  const auto it = object_.find(key);
  ThrowIf(it == object_.end(), "{}: {}{} is missing", source_, place_, key);
  return *it;
}

bool JsonObject::HasValue(const std::string& key) const {
  const auto it = object_.find(key);
  return it != object_.end() && !it->is_null();
}

JsonObject JsonObject::Object(const std::string& key) const {
  return {Get(key), source_, place_ + key + "."};
}

const nlohmann::json& JsonObject::List(const std::string& key) const {
  const nlohmann::json& value = Get(key);
  if (!value.is_array()) Fail(place_ + key, value, "a list");
  return value;
}

JsonObject JsonObject::Element(const std::string& key, std::size_t i) const {
  return {List(key).at(i), source_, fmt::format("{}{}[{}].", place_, key, i)};
}

std::string JsonObject::Text(const std::string& key) const {
  const nlohmann::json& value = Get(key);
  if (!value.is_string()) Fail(place_ + key, value, "a text");
  return value.get<std::string>();
}

double JsonObject::Number(const std::string& key, double min, double max) const {
  const nlohmann::json& value = Get(key);
  RequireNumber(place_ + key, value, min, max);
  return value.get<double>();
}

int JsonObject::Count(const std::string& key) const {
  const nlohmann::json& value = Get(key);
  RequireCount(place_ + key, value);
  return value.get<int>();
}

void JsonObject::RequireNumber(const std::string& what, const nlohmann::json& value, double min,
                               double max) const {
  if (value.is_number() && value.get<double>() >= min && value.get<double>() <= max) return;
  Fail(what, value, fmt::format("a number from {} to {}", min, max));
}

void JsonObject::RequireCount(const std::string& what, const nlohmann::json& value) const {
  if (value.is_number_integer() && value.get<double>() >= 0 && value.get<double>() <= 1e9) return;
  Fail(what, value, "a whole number from 0 to 1e9");
}

}  // namespace slalom::base
