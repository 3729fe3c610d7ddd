#include "policy/policy_spec.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/json.h"
#include "policy/nn/encoder_slots.h"

namespace slalom::policy {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxLayers = 64;  // Largest number of layers of encoder or head.

template <class T>
json ToJson(const T& value) {
  return value;
}
template <base::NamedEnum E>
json ToJson(const E& value) {
  return base::EnumName(value);
}

/// Writes the fields of a config struct as JSON.
class JsonWriter {
 public:
  explicit JsonWriter(json& object) : object_(object) {}
  template <class T, class... Rest>
  void operator()(const char* key, T& value, const Rest&...) {
    object_[key] = ToJson(value);
  }

 private:
  json& object_;
};

/// Reads the fields of a config struct, all of which must be there and within their ranges.
class JsonReader {
 public:
  JsonReader(const json& parent, const char* name, std::string_view source)
      : object_(Find(parent, name, name, source)), name_(name), source_(source) {}

  template <class... Rest>
  void operator()(const char* key, bool& value, const Rest&...) {
    const json& found = At(key);
    if (!found.is_boolean()) Fail(key, found, "true or false");
    value = found.get<bool>();
  }
  template <class... Rest>
  void operator()(const char* key, int& value, base::Range range, const Rest&...) {
    value = Whole(key, At(key), range);
  }
  template <class... Rest>
  void operator()(const char* key, double& value, base::Range range, const Rest&...) {
    const json& found = At(key);
    if (!found.is_number() || !IsIn(found.get<double>(), range)) {
      Fail(key, found, fmt::format("a number from {} to {}", range.min, range.max));
    }
    value = found.get<double>();
  }
  template <class... Rest>
  void operator()(const char* key, std::string& value, const base::OneOf& texts, const Rest&...) {
    const json& found = At(key);
    if (!found.is_string() || std::ranges::count(texts.choices, found.get<std::string>()) == 0) {
      Fail(key, found, fmt::format("{}", fmt::join(texts.choices, " or ")));
    }
    value = found.get<std::string>();
  }
  template <base::NamedEnum E, class... Rest>
  void operator()(const char* key, E& value, const Rest&...) {
    const json& found = At(key);
    if (!found.is_string() || !base::ParseEnum(found.get<std::string>(), value)) {
      Fail(key, found, fmt::format("{}", fmt::join(EnumNames(value).choices, " or ")));
    }
  }
  template <class... Rest>
  void operator()(const char* key, std::vector<int>& value, base::Range range, const Rest&...) {
    const json& found = At(key);
    if (!found.is_array() || found.size() > kMaxLayers) {
      Fail(key, found, fmt::format("a list of at most {} numbers", kMaxLayers));
    }
    value.clear();
    for (const json& element : found) value.push_back(Whole(key, element, range));
  }

  static const json& Find(const json& object, const char* key, std::string_view path,
                          std::string_view source) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (found == object.end()) {
      throw base::Error(fmt::format("{}: '{}' is missing in its spec", source, path));
    }
    return *found;
  }

 private:
  const json& At(const char* key) const {
    return Find(object_, key, fmt::format("{}.{}", name_, key), source_);
  }
  static bool IsIn(double value, base::Range range) {
    return value >= range.min && value <= range.max;
  }
  int Whole(const char* key, const json& found, base::Range range) const {
    if (!found.is_number_integer() || !IsIn(found.get<double>(), range)) {
      Fail(key, found, fmt::format("whole numbers from {} to {}", range.min, range.max));
    }
    return found.get<int>();
  }
  [[noreturn]] void Fail(const char* key, const json& found, std::string_view expected) const {
    std::string text = found.dump(-1, ' ', false, json::error_handler_t::replace);
    if (text.size() > 60) text = text.substr(0, 57) + "...";
    throw base::Error(fmt::format("{}: '{}.{}' in its spec is {}, expected {}", source_, name_, key,
                                  text, expected));
  }

  const json& object_;
  const std::string_view name_;
  const std::string_view source_;
};

/// The fields of an observation spec, which is no config struct, in the ranges of a task's config.
template <class Visitor>
void VisitObservation(env::ObservationSpec& spec, Visitor& v) {
  v("num_beams", spec.num_beams, base::Range{0, 65536});
  v("state_size", spec.state_size, base::Range{1, env::kMaxStateSize});
  v("range_clip", spec.range_clip, base::Range{0.5, 600.0});
  v("goal_scale", spec.goal_scale, base::Range{0.1, 1000.0});
  spec.StateOptions::Visit(v);
}

/// Lists the fields of a config struct as "SECTION.KEY" and JSON, in the order of its `Visit`.
class FieldLister {
 public:
  using Fields = std::vector<std::pair<std::string, std::string>>;

  FieldLister(const char* section, Fields& fields) : section_(section), fields_(fields) {}
  template <class T, class... Rest>
  void operator()(const char* key, T& value, const Rest&...) {
    fields_.emplace_back(fmt::format("{}.{}", section_, key), ToJson(value).dump());
  }

 private:
  const char* const section_;
  Fields& fields_;
};

FieldLister::Fields ListSpec(PolicySpec spec) {
  FieldLister::Fields fields;
  FieldLister observation("observation", fields);
  VisitObservation(spec.observation, observation);
  FieldLister network("network", fields);
  spec.network.Visit(network);
  fields.emplace_back("action_size", std::to_string(spec.action_size));
  FieldLister actions("actions", fields);
  spec.actions.Visit(actions);
  FieldLister distribution("distribution", fields);
  spec.distribution.Visit(distribution);
  FieldLister planning("planning", fields);
  spec.planning.Visit(planning);
  return fields;
}

/// Fields that came after the first policies were written, which do without them.
constexpr std::array kLaterNetworkFields = {"cnn_axis", "attention_heads", "dropout",
                                            "dropout_everywhere"};
constexpr std::array kLaterPlanningFields = {"goal_radius", "goal_reward", "success"};

template <class Section>
void AddLaterFields(const char* name, std::span<const char* const> keys, json& object) {
  const auto section = object.find(name);
  if (section == object.end() || !section->is_object()) return;
  json defaults;
  JsonWriter writer(defaults);
  Section().Visit(writer);
  for (const char* const key : keys) {
    if (!section->contains(key)) (*section)[key] = defaults[key];
  }
}

}  // namespace

std::string PrintSpec(const PolicySpec& spec, std::int64_t version) {
  PolicySpec printed = spec;
  json object;
  object["version"] = version;
  JsonWriter observation(object["observation"]);
  VisitObservation(printed.observation, observation);
  JsonWriter network(object["network"]);
  printed.network.Visit(network);
  object["action_size"] = spec.action_size;
  JsonWriter actions(object["actions"]);
  printed.actions.Visit(actions);
  if (!spec.distribution.is_deterministic()) {
    JsonWriter distribution(object["distribution"]);
    printed.distribution.Visit(distribution);
  }
  if (spec.planning.is_carried()) {
    JsonWriter planning(object["planning"]);
    printed.planning.Visit(planning);
  }
  return object.dump();
}

void ParseSpec(std::string_view text, std::string_view source, PolicySnapshot* snapshot) {
  json object = base::ParseJson(text);
  if (!object.is_object()) {
    throw base::Error(fmt::format("{}: its spec is not a JSON object", source));
  }
  AddLaterFields<nn::NetworkConfig>("network", kLaterNetworkFields, object);
  AddLaterFields<PlanningSpec>("planning", kLaterPlanningFields, object);
  if (!object.contains("action_size")) object["action_size"] = env::kActionSize;
  if (const auto found = object.find("observation"); found != object.end() && found->is_object()) {
    // A file observes nothing of what it does not name.
    json observation = {{"state_size", env::kStateSize}};
    JsonWriter writer(observation);
    env::StateOptions().Visit(writer);
    observation.update(*found);
    *found = std::move(observation);
  }
  const json& version = JsonReader::Find(object, "version", "version", source);
  const bool is_count = version.is_number_unsigned() &&
                        version.get<std::uint64_t>() <= std::numeric_limits<std::int64_t>::max();
  if (!is_count) {
    throw base::Error(
        fmt::format("{}: 'version' in its spec is not a whole number of 0 or more", source));
  }
  snapshot->version = version.get<std::int64_t>();
  PolicySpec& spec = snapshot->spec;
  JsonReader observation(object, "observation", source);
  VisitObservation(spec.observation, observation);
  JsonReader network(object, "network", source);
  spec.network.Visit(network);
  const json& action_size = object["action_size"];
  const bool is_size =
      action_size.is_number_integer() && action_size >= 1 && action_size <= env::kMaxActionSize;
  if (!is_size) {
    throw base::Error(
        fmt::format("{}: 'action_size' in its spec is not a whole number from 1 to {}", source,
                    env::kMaxActionSize));
  }
  spec.action_size = action_size.get<int>();
  JsonReader actions(object, "actions", source);
  spec.actions.Visit(actions);
  spec.distribution = {};
  if (object.contains("distribution")) {
    JsonReader distribution(object, "distribution", source);
    spec.distribution.Visit(distribution);
  }
  spec.planning = {};
  if (object.contains("planning")) {
    JsonReader planning(object, "planning", source);
    spec.planning.Visit(planning);
  }
  try {  // The fields must agree with each other.
    nn::CheckNetwork(spec.network);
    (void)spec.actor_shape();
    if (spec.planning.is_carried()) (void)spec.model_shape();
  } catch (const base::Error& error) {
    throw base::Error(fmt::format("{}: in its spec, {}", source, error.what()));
  }
}

void RequireSameSpec(const std::string& source, const PolicySpec& spec,
                     const PolicySpec& expected) {
  if (spec.planning.is_carried() != expected.planning.is_carried()) {
    throw base::Error(fmt::format("{}: carries {} transition model, expected {}", source,
                                  spec.planning.is_carried() ? "a" : "no",
                                  expected.planning.is_carried() ? "one" : "none"));
  }
  const FieldLister::Fields found = ListSpec(spec), wanted = ListSpec(expected);
  const auto [is, should] = std::ranges::mismatch(found, wanted);
  if (is == found.end()) return;
  throw base::Error(
      fmt::format("{}: its {} is {}, expected {}", source, is->first, is->second, should->second));
}

}  // namespace slalom::policy
