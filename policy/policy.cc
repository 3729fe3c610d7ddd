#include "policy/policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "policy/feature_map.h"
#include "policy/policy_spec.h"

namespace slalom::policy {
namespace {

constexpr const char* kSpecKey = "slalom_policy";
constexpr const char* kFormatKey = "slalom_format";
constexpr const char* kFormat = "slalom-policy-1";

}  // namespace

NetworkShape PolicySpec::actor_shape() const {
  return ActorShape(network, FeatureMap(observation, network).frame_size(),
                    distribution.num_outputs());
}

std::string PrintPolicy(const PolicySnapshot& snapshot, const Metadata& metadata) {
  TensorMap tensors;
  const NetworkShape shape = snapshot.spec.actor_shape();
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(snapshot.weights->size()), shape.num_parameters());
  const std::span<const float> weights(*snapshot.weights);
  for (const ParameterSlot& slot : shape.Slots()) {
    tensors.emplace("actor." + slot.name,
                    StoredTensor::Of(weights.subspan(slot.offset, slot.size()), slot.shape));
  }
  Metadata all = metadata;
  all[kFormatKey] = kFormat;
  all[kSpecKey] = PrintSpec(snapshot.spec, snapshot.version);
  return PrintTensors(tensors, all);
}

LoadedPolicy ParsePolicy(std::span<const std::byte> bytes, std::string_view source) {
  TensorFile file = ParseTensors(bytes, source);
  const auto format = file.metadata.extract(kFormatKey);
  const auto spec = file.metadata.extract(kSpecKey);
  if (format.empty() || format.mapped() != kFormat || spec.empty()) {
    throw base::Error(
        fmt::format("{}: found a safetensors file without '{}' = {}, expected a policy "
                    "saved by slalom",
                    file.source, kFormatKey, kFormat));
  }
  LoadedPolicy loaded;
  ParseSpec(spec.mapped(), source, &loaded.snapshot);
  const NetworkShape shape = loaded.snapshot.spec.actor_shape();
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
    const auto values = std::span(*weights).subspan(slot.offset, slot.size());
    file.Read("actor." + slot.name, values);
    if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) {
      throw base::Error(fmt::format("{}: tensor 'actor.{}' holds numbers that are not finite",
                                    source, slot.name));
    }
  }
  loaded.snapshot.weights = std::move(weights);
  loaded.metadata = std::move(file.metadata);
  return loaded;
}

void SavePolicy(const std::filesystem::path& path, const PolicySnapshot& snapshot,
                const Metadata& metadata) {
  base::WriteFileAtomically(path, PrintPolicy(snapshot, metadata));
}

LoadedPolicy LoadPolicy(const std::filesystem::path& path) {
  const std::string bytes = base::ReadFile(path);
  return ParsePolicy(std::as_bytes(std::span(bytes)), path.string());
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
