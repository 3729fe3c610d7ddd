#include "policy/nn/network_shape.h"

#include <fmt/format.h>

#include "policy/nn/encoder_slots.h"

namespace slalom::nn {
namespace {

NetworkShape BodyShape(const NetworkConfig& config, int frame_size, int num_outputs) {
  CheckNetwork(config);
  NetworkShape shape;
  shape.config = config;
  shape.encoder = EncoderOf(config);
  shape.frame_size = frame_size;
  if (shape.has_encoder()) {
    EncoderSlots(config, frame_size);  // Throws if the frames are too small for it.
    shape.mlp.num_inputs = config.encoder_layers.back();
  } else {
    shape.mlp.num_inputs = shape.num_inputs();
    shape.mlp.hidden = config.encoder_layers;
    shape.mlp.num_encoder_layers = static_cast<int>(config.encoder_layers.size());
  }
  shape.mlp.hidden.insert(shape.mlp.hidden.end(), config.head_layers.begin(),
                          config.head_layers.end());
  shape.mlp.num_outputs = num_outputs;
  return shape;
}

}  // namespace

int MlpShape::layer_inputs(int layer) const {
  const int inputs = layer == 0 ? num_inputs : hidden[layer - 1];
  return layer == extra_layer ? inputs + num_extra : inputs;
}

int MlpShape::layer_outputs(int layer) const {
  return layer + 1 == num_layers() ? num_outputs : hidden[layer];
}

std::string MlpShape::layer_name(int layer) const {
  return layer < num_encoder_layers ? fmt::format("encoder.{}", layer)
                                    : fmt::format("head.{}", layer - num_encoder_layers);
}

std::vector<ParameterSlot> MlpShape::Slots() const {
  ParameterSlots slots;
  for (int i = 0; i < num_layers(); ++i) {
    const std::string layer = layer_name(i);
    slots.AddLinear(layer, layer_outputs(i), layer_inputs(i));
    if (layer_norm && i + 1 < num_layers()) slots.AddNorm(layer + ".norm", layer_outputs(i));
  }
  return slots.Take();
}

std::vector<ParameterSlot> NetworkShape::Slots() const {
  ParameterSlots slots;
  if (has_encoder()) slots.Append(EncoderSlots(config, frame_size));
  slots.Append(mlp.Slots());
  return slots.Take();
}

NetworkShape ActorShape(const NetworkConfig& config, int frame_size, int num_outputs) {
  return BodyShape(config, frame_size, num_outputs);
}

NetworkShape CriticShape(const NetworkConfig& config, int frame_size, int num_outputs,
                         int action_size) {
  NetworkShape shape = BodyShape(config, frame_size, num_outputs);
  shape.mlp.num_extra = action_size;
  shape.mlp.extra_layer = shape.mlp.num_encoder_layers;
  shape.mlp.layer_norm = config.layer_norm;
  return shape;
}

void InitialiseParameters(const NetworkShape& shape, base::Random& random,
                          std::span<float> parameters) {
  InitialiseParameters(shape.Slots(), random, parameters);
}

}  // namespace slalom::nn
