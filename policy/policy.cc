#include "policy/policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "policy/nn/feature_map.h"
#include "policy/policy_spec.h"

namespace slalom::policy {
namespace {

constexpr const char* kSpecKey = "slalom_policy";
constexpr const char* kFormatKey = "slalom_format";
constexpr const char* kFormat = "slalom-policy-1";

/// Adds a network's parameters to `tensors`, which are named as its slots behind `prefix`.
template <class Shape>
void Store(const std::string& prefix, const Shape& shape, std::span<const float> weights,
           nn::TensorMap* tensors) {
  for (const nn::ParameterSlot& slot : shape.Slots()) {
    tensors->emplace(prefix + slot.name,
                     nn::StoredTensor::Of(weights.subspan(slot.offset, slot.size()), slot.shape));
  }
}

/// Appends the parameters of `shape` to `weights`. Throws `base::Error` if one is missing, of
/// another shape or not finite.
template <class Shape>
void Read(const nn::TensorFile& file, const std::string& prefix, const Shape& shape,
          std::vector<float>* weights) {
  for (const nn::ParameterSlot& slot : shape.Slots()) {
    const std::string name = prefix + slot.name;
    const auto tensor = file.tensors.find(name);
    base::ThrowIf(tensor == file.tensors.end() || tensor->second.shape != slot.shape,
                  "{}: tensor '{}' is missing or not [{}], which the spec in the file asks for",
                  file.source, name, fmt::join(slot.shape, ", "));
    weights->resize(weights->size() + slot.size());
    const auto values = std::span(*weights).last(slot.size());
    file.Read(name, values);
    if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) {
      throw base::Error("{}: tensor '{}' holds numbers that are not finite", file.source, name);
    }
  }
}

/// "720 beams clipped at 5 m and goals scaled by 5 m".
std::string DescribeObservation(const env::ObservationSpec& spec) {
  std::string text = fmt::format("{} beams clipped at {} m and goals scaled by {} m",
                                 spec.num_beams, spec.range_clip, spec.goal_scale);
  for (const env::StateField& field : env::kStateFields) {
    const int more = field.num_items(spec) - field.num_items({});
    if (more > 0) text += fmt::format(", with {}", field.name);
    if (more > 1) text += fmt::format(" x {}", more);
  }
  return text;
}

std::string MemberPrefix(int member) { return fmt::format("model.{}.", member); }

}  // namespace

nn::NetworkShape PolicySpec::actor_shape() const {
  return nn::ActorShape(network, nn::FeatureMap(observation, network).frame_size(),
                        distribution.num_outputs(action_size));
}

nn::NetworkShape PolicySpec::critic_shape(int num_outputs) const {
  return nn::CriticShape(network, nn::FeatureMap(observation, network).frame_size(), num_outputs,
                         action_size);
}

void PolicySpec::RequireCourses(const std::string& source) const {
  const bool is_of_course =
      observation.state_size == env::StateSize(observation) && action_size == env::kActionSize;
  if (is_of_course && observation.num_beams > 0) return;
  throw base::Error(
      "{}: found scans of {} beams, states of {} numbers and actions of {}, expected a policy for "
      "courses",
      source, observation.num_beams, observation.state_size, action_size);
}

nn::ModelShape PolicySpec::model_shape() const {
  RequireCourses("model.kind");
  return nn::MakeModelShape(planning.model, network,
                            nn::FeatureMap(observation, network).frame_size(), observation,
                            planning.goal);
}

PolicySnapshot WithoutPlanning(PolicySnapshot snapshot) {
  snapshot.spec.planning = {};
  snapshot.model_weights = nullptr;
  snapshot.critic_weights = nullptr;
  return snapshot;
}

PolicySnapshot ZeroSnapshot(const PolicySpec& spec) {
  const auto zeros = [](std::int64_t n) {
    return std::make_shared<const std::vector<float>>(static_cast<std::size_t>(n), 0.0f);
  };
  PolicySnapshot snapshot{-1, spec, zeros(spec.actor_shape().num_parameters()), nullptr, nullptr};
  if (spec.planning.is_carried()) {
    snapshot.model_weights = zeros(spec.model_shape().num_parameters());
    snapshot.critic_weights = zeros(spec.critic_shape().num_parameters());
  }
  return snapshot;
}

std::string PrintPolicy(const PolicySnapshot& snapshot, const nn::Metadata& metadata) {
  nn::TensorMap tensors;
  const nn::NetworkShape shape = snapshot.spec.actor_shape();
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(snapshot.weights->size()), shape.num_parameters());
  Store("actor.", shape, *snapshot.weights, &tensors);
  if (snapshot.spec.planning.is_carried()) {
    const nn::ModelShape model = snapshot.spec.model_shape();
    const std::span<const float> members(*snapshot.model_weights);
    SLALOM_CHECK_EQ(static_cast<std::int64_t>(members.size()), model.num_parameters());
    const auto size = static_cast<std::size_t>(model.num_member_parameters());
    for (int i = 0; i < model.ensemble; ++i) {
      Store(MemberPrefix(i), model.network, members.subspan(i * size, size), &tensors);
    }
    Store("critic.", snapshot.spec.critic_shape(), *snapshot.critic_weights, &tensors);
  }
  nn::Metadata all = metadata;
  all[kFormatKey] = kFormat;
  all[kSpecKey] = PrintSpec(snapshot.spec, snapshot.version);
  return nn::PrintTensors(tensors, all);
}

LoadedPolicy ParsePolicy(std::span<const std::byte> bytes, std::string_view source) {
  nn::TensorFile file = nn::ParseTensors(bytes, source);
  const auto format = file.metadata.extract(kFormatKey);
  const auto spec = file.metadata.extract(kSpecKey);
  base::ThrowIf(format.empty() || format.mapped() != kFormat || spec.empty(),
                "{}: found a safetensors file without '{}' = {}, expected a policy saved by slalom",
                file.source, kFormatKey, kFormat);
  LoadedPolicy loaded;
  ParseSpec(spec.mapped(), source, &loaded.snapshot);
  PolicySnapshot& snapshot = loaded.snapshot;
  std::vector<float> actor, model, critic;
  Read(file, "actor.", snapshot.spec.actor_shape(), &actor);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(actor));
  if (snapshot.spec.planning.is_carried()) {
    const nn::ModelShape shape = snapshot.spec.model_shape();
    for (int i = 0; i < shape.ensemble; ++i) Read(file, MemberPrefix(i), shape.network, &model);
    Read(file, "critic.", snapshot.spec.critic_shape(), &critic);
    snapshot.model_weights = std::make_shared<const std::vector<float>>(std::move(model));
    snapshot.critic_weights = std::make_shared<const std::vector<float>>(std::move(critic));
  }
  loaded.metadata = std::move(file.metadata);
  return loaded;
}

void SavePolicy(const std::filesystem::path& path, const PolicySnapshot& snapshot,
                const nn::Metadata& metadata) {
  base::WriteFileAtomically(path, PrintPolicy(snapshot, metadata));
}

LoadedPolicy LoadPolicy(const std::filesystem::path& path) {
  const std::string bytes = base::ReadFile(path);
  return ParsePolicy(std::as_bytes(std::span(bytes)), path.string());
}

void RequireSameInterface(const std::string& source, const PolicySpec& spec,
                          const env::ObservationSpec& observation,
                          const env::ActionBounds& actions) {
  spec.RequireCourses(source);
  base::ThrowIf(spec.observation != observation, "{}: the policy sees {}, the simulator gives {}",
                source, DescribeObservation(spec.observation), DescribeObservation(observation));
  base::ThrowIf(
      spec.actions.linear_min != actions.linear_min ||
          spec.actions.linear_max != actions.linear_max ||
          spec.actions.angular_max != actions.angular_max,
      "{}: the policy commands {} to {} m/s and {} rad/s, the simulator is set to {} to {} m/s "
      "and {} rad/s",
      source, spec.actions.linear_min, spec.actions.linear_max, spec.actions.angular_max,
      actions.linear_min, actions.linear_max, actions.angular_max);
}

}  // namespace slalom::policy
