#include "policy/policy_spec.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
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
class SpecReader {
 public:
  explicit SpecReader(base::JsonObject object) : object_(std::move(object)) {}

  template <class... Rest>
  void operator()(const char* key, bool& value, const Rest&...) {
    const json& found = object_.Get(key);
    if (!found.is_boolean()) Fail(key, found, "true or false");
    value = found.get<bool>();
  }
  template <class... Rest>
  void operator()(const char* key, int& value, base::Range range, const Rest&...) {
    value = Whole(key, object_.Get(key), range);
  }
  template <class... Rest>
  void operator()(const char* key, double& value, base::Range range, const Rest&...) {
    value = object_.Number(key, range.min, range.max);
  }
  template <class... Rest>
  void operator()(const char* key, std::string& value, const base::OneOf& texts, const Rest&...) {
    const json& found = object_.Get(key);
    if (!found.is_string() || std::ranges::count(texts.choices, found.get<std::string>()) == 0) {
      Fail(key, found, fmt::format("{}", fmt::join(texts.choices, " or ")));
    }
    value = found.get<std::string>();
  }
  template <base::NamedEnum E, class... Rest>
  void operator()(const char* key, E& value, const Rest&...) {
    const json& found = object_.Get(key);
    if (!found.is_string() || !base::ParseEnum(found.get<std::string>(), value)) {
      Fail(key, found, fmt::format("{}", fmt::join(EnumNames(value).choices, " or ")));
    }
  }
  template <class... Rest>
  void operator()(const char* key, std::vector<int>& value, base::Range range, const Rest&...) {
    const json& found = object_.Get(key);
    if (!found.is_array() || found.size() > kMaxLayers) {
      Fail(key, found, fmt::format("a list of at most {} numbers", kMaxLayers));
    }
    value.clear();
    for (const json& element : found) value.push_back(Whole(key, element, range));
  }

  int Whole(const char* key, const json& found, base::Range range) const {
    const bool is_whole = found.is_number_integer() && found.get<double>() >= range.min &&
                          found.get<double>() <= range.max;
    if (!is_whole)
      Fail(key, found, fmt::format("whole numbers from {} to {}", range.min, range.max));
    return found.get<int>();
  }
  [[noreturn]] void Fail(const char* key, const json& found, std::string_view expected) const {
    object_.Fail(object_.place() + key, found, expected);
  }

 private:
  const base::JsonObject object_;
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
  const json parsed = base::ParseJson(text);
  base::ThrowIf(!parsed.is_object(), "{}: its spec is not a JSON object", source);
  const base::JsonObject object(parsed, std::string(source), "spec.");
  const json& version = object.Get("version");
  const bool is_count = version.is_number_unsigned() &&
                        version.get<std::uint64_t>() <= std::numeric_limits<std::int64_t>::max();
  if (!is_count) object.Fail("spec.version", version, "a whole number of 0 or more");
  snapshot->version = version.get<std::int64_t>();
  PolicySpec& spec = snapshot->spec;
  SpecReader observation(object.Object("observation"));
  VisitObservation(spec.observation, observation);
  SpecReader network(object.Object("network"));
  spec.network.Visit(network);
  SpecReader sizes(object);
  sizes("action_size", spec.action_size, base::Range{1, env::kMaxActionSize});
  SpecReader actions(object.Object("actions"));
  spec.actions.Visit(actions);
  spec.distribution = {};
  if (parsed.contains("distribution")) {
    SpecReader distribution(object.Object("distribution"));
    spec.distribution.Visit(distribution);
  }
  spec.planning = {};
  if (parsed.contains("planning")) {
    SpecReader planning(object.Object("planning"));
    spec.planning.Visit(planning);
  }
  try {  // The fields must agree with each other.
    nn::CheckNetwork(spec.network);
    (void)spec.actor_shape();
    if (spec.planning.is_carried()) (void)spec.model_shape();
  } catch (const base::Error& error) {
    throw base::Error("{}: in its spec, {}", source, error.what());
  }
}

void RequireSameSpec(const std::string& source, const PolicySpec& spec,
                     const PolicySpec& expected) {
  if (spec.planning.is_carried() != expected.planning.is_carried()) {
    throw base::Error("{}: carries {} transition model, expected {}", source,
                      spec.planning.is_carried() ? "a" : "no",
                      expected.planning.is_carried() ? "one" : "none");
  }
  const FieldLister::Fields found = ListSpec(spec), wanted = ListSpec(expected);
  const auto [is, should] = std::ranges::mismatch(found, wanted);
  if (is == found.end()) return;
  throw base::Error("{}: its {} is {}, expected {}", source, is->first, is->second, should->second);
}

}  // namespace slalom::policy
