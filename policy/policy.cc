#include "policy/policy.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/check.h"
#include "base/error.h"
#include "policy/feature_map.h"

namespace slalom::policy {
namespace {

using nlohmann::json;

constexpr const char* kSpecKey = "slalom_policy";
constexpr const char* kFormatKey = "slalom_format";
constexpr const char* kFormat = "slalom-policy-1";

/// Writes the fields of a config struct as JSON.
class JsonWriter {
 public:
  explicit JsonWriter(json& object) : object_(object) {}
  template <class T, class... Rest>
  void operator()(const char* key, T& value, const Rest&...) {
    object_[key] = value;
  }

 private:
  json& object_;
};

/// Reads the fields of a config struct, all of which must be there; a JSON exception where not.
class JsonReader {
 public:
  explicit JsonReader(const json& object) : object_(object) {}
  template <class T, class... Rest>
  void operator()(const char* key, T& value, const Rest&...) {
    value = object_.at(key).get<T>();
  }

 private:
  const json& object_;
};

std::string PrintSpec(PolicySpec spec, std::int64_t version) {
  json object;
  object["version"] = version;
  object["observation"] = {{"num_beams", spec.observation.num_beams},
                           {"range_clip", spec.observation.range_clip},
                           {"goal_scale", spec.observation.goal_scale}};
  JsonWriter network(object["network"]);
  spec.network.Visit(network);
  JsonWriter actions(object["actions"]);
  spec.actions.Visit(actions);
  return object.dump();
}

void ParseSpec(const std::string& text, PolicySnapshot& snapshot) {
  const json object = json::parse(text);
  snapshot.version = object.at("version").get<std::int64_t>();
  const json& observation = object.at("observation");
  PolicySpec& spec = snapshot.spec;
  spec.observation.num_beams = observation.at("num_beams").get<int>();
  spec.observation.range_clip = observation.at("range_clip").get<double>();
  spec.observation.goal_scale = observation.at("goal_scale").get<double>();
  JsonReader network(object.at("network"));
  spec.network.Visit(network);
  JsonReader actions(object.at("actions"));
  spec.actions.Visit(actions);
}

/// Whether the numbers of a spec may size arrays: a file's word is not taken for it.
bool IsSane(const PolicySpec& spec) {
  constexpr int kMost = 1 << 16;
  const auto within = [](int value, int low) { return value >= low && value <= kMost; };
  bool sane = within(spec.observation.num_beams, 1) && within(spec.network.history, 1) &&
              within(spec.network.sectors, 0) && spec.observation.range_clip > 0.0 &&
              spec.observation.range_clip < 1000.0;
  for (const int width : spec.network.encoder_layers) sane = sane && within(width, 1);
  for (const int width : spec.network.head_layers) sane = sane && within(width, 1);
  return sane;
}

}  // namespace

MlpShape PolicySpec::actor_shape() const {
  return ActorShape(network, FeatureMap(observation, network).frame_size());
}

void SavePolicy(const std::filesystem::path& path, const PolicySnapshot& snapshot,
                const Metadata& metadata) {
  TensorMap tensors;
  const MlpShape shape = snapshot.spec.actor_shape();
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(snapshot.weights->size()), shape.num_parameters());
  const std::span<const float> weights(*snapshot.weights);
  for (const ParameterSlot& slot : shape.Slots()) {
    tensors.emplace("actor." + slot.name,
                    StoredTensor::Of(weights.subspan(slot.offset, slot.size()), slot.shape));
  }
  Metadata all = metadata;
  all[kFormatKey] = kFormat;
  all[kSpecKey] = PrintSpec(snapshot.spec, snapshot.version);
  SaveTensors(path, tensors, all);
}

LoadedPolicy LoadPolicy(const std::filesystem::path& path) {
  TensorFile file = LoadTensors(path);
  const auto format = file.metadata.extract(kFormatKey);
  const auto spec = file.metadata.extract(kSpecKey);
  if (format.empty() || format.mapped() != kFormat || spec.empty()) {
    throw base::Error(
        fmt::format("{}: found a safetensors file without '{}' = {}, expected a policy "
                    "saved by slalom",
                    file.source, kFormatKey, kFormat));
  }
  LoadedPolicy loaded;
  try {
    ParseSpec(spec.mapped(), loaded.snapshot);
  } catch (const json::exception& error) {
    throw base::Error(fmt::format("{}: '{}' in its metadata cannot be read: {}", file.source,
                                  kSpecKey, error.what()));
  }
  if (!IsSane(loaded.snapshot.spec)) {
    throw base::Error(
        fmt::format("{}: '{}' in its metadata holds impossible sizes", file.source, kSpecKey));
  }
  const MlpShape shape = loaded.snapshot.spec.actor_shape();
  const std::vector<ParameterSlot> slots = shape.Slots();
  auto weights = std::make_shared<std::vector<float>>();
  for (const ParameterSlot& slot : slots) {
    const auto tensor = file.tensors.find("actor." + slot.name);
    if (tensor == file.tensors.end() || tensor->second.shape != slot.shape) {
      throw base::Error(
          fmt::format("{}: tensor 'actor.{}' is missing or not [{}], which the spec in "
                      "the file asks for",
                      file.source, slot.name, fmt::join(slot.shape, ", ")));
    }
    weights->resize(slot.offset + slot.size());
    file.Read("actor." + slot.name, std::span(*weights).subspan(slot.offset, slot.size()));
  }
  loaded.snapshot.weights = std::move(weights);
  loaded.metadata = std::move(file.metadata);
  return loaded;
}

void RequireSameInterface(const std::string& source, const PolicySpec& spec,
                          const env::ObservationSpec& observation,
                          const env::ActionBounds& actions) {
  if (spec.observation != observation) {
    throw base::Error(
        fmt::format("{}: the policy sees {} beams clipped at {} m and goals scaled by {} m, the "
                    "simulator gives {} "
                    "beams clipped at {} m and goals scaled by {} m",
                    source, spec.observation.num_beams, spec.observation.range_clip,
                    spec.observation.goal_scale, observation.num_beams, observation.range_clip,
                    observation.goal_scale));
  }
  if (spec.actions.linear_min != actions.linear_min ||
      spec.actions.linear_max != actions.linear_max ||
      spec.actions.angular_max != actions.angular_max) {
    throw base::Error(fmt::format(
        "{}: the policy commands {} to {} m/s and {} rad/s, the simulator is set to {} to {} m/s "
        "and {} "
        "rad/s",
        source, spec.actions.linear_min, spec.actions.linear_max, spec.actions.angular_max,
        actions.linear_min, actions.linear_max, actions.angular_max));
  }
}

}  // namespace slalom::policy
