#include "policy/mlp_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "base/check.h"

namespace slalom::policy {
namespace {

constexpr int kActionSize = 2;

MlpShape BodyShape(const NetworkConfig& config, int frame_size) {
  MlpShape shape;
  shape.num_inputs = config.history * frame_size;
  shape.hidden = config.encoder_layers;
  shape.hidden.insert(shape.hidden.end(), config.head_layers.begin(), config.head_layers.end());
  shape.num_encoder_layers = static_cast<int>(config.encoder_layers.size());
  return shape;
}

}  // namespace

std::int64_t ParameterSlot::size() const {
  return std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>());
}

int MlpShape::layer_inputs(int layer) const {
  const int inputs = layer == 0 ? num_inputs : hidden[layer - 1];
  return layer == extra_layer ? inputs + num_extra : inputs;
}

int MlpShape::layer_outputs(int layer) const {
  return layer + 1 == num_layers() ? num_outputs : hidden[layer];
}

std::vector<ParameterSlot> MlpShape::Slots() const {
  std::vector<ParameterSlot> slots;
  std::int64_t offset = 0;
  const auto add = [&](std::string name, std::vector<std::int64_t> shape, int fan_in) {
    slots.push_back({std::move(name), offset, std::move(shape), fan_in});
    offset += slots.back().size();
  };
  for (int i = 0; i < num_layers(); ++i) {
    const std::string layer = i < num_encoder_layers
                                  ? fmt::format("encoder.{}", i)
                                  : fmt::format("head.{}", i - num_encoder_layers);
    const int inputs = layer_inputs(i);
    const int outputs = layer_outputs(i);
    add(layer + ".weight", {outputs, inputs}, inputs);
    add(layer + ".bias", {outputs}, inputs);
    if (layer_norm && i + 1 < num_layers()) {
      add(layer + ".norm.weight", {outputs}, 0);
      add(layer + ".norm.bias", {outputs}, 0);
    }
  }
  return slots;
}

std::int64_t MlpShape::num_parameters() const {
  const std::vector<ParameterSlot> slots = Slots();
  return slots.back().offset + slots.back().size();
}

MlpShape ActorShape(const NetworkConfig& config, int frame_size, int num_outputs) {
  MlpShape shape = BodyShape(config, frame_size);
  shape.num_outputs = num_outputs;
  return shape;
}

MlpShape CriticShape(const NetworkConfig& config, int frame_size) {
  MlpShape shape = BodyShape(config, frame_size);
  shape.num_outputs = 1;
  shape.num_extra = kActionSize;
  shape.extra_layer = shape.num_encoder_layers;
  shape.layer_norm = config.layer_norm;
  return shape;
}

void InitialiseParameters(const MlpShape& shape, base::Random& random,
                          std::span<float> parameters) {
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(parameters.size()), shape.num_parameters());
  for (const ParameterSlot& slot : shape.Slots()) {
    const auto values = parameters.subspan(slot.offset, slot.size());
    if (slot.fan_in > 0) {
      const double bound = 1.0 / std::sqrt(static_cast<double>(slot.fan_in));
      for (float& value : values) value = static_cast<float>(random.Uniform(-bound, bound));
    } else {
      std::fill(values.begin(), values.end(), slot.name.ends_with(".norm.weight") ? 1.0f : 0.0f);
    }
  }
}

}  // namespace slalom::policy
