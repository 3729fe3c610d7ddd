#include "policy/nn/network_shape.h"

#include "env/action.h"
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
    EncoderSlots(config, frame_size);  // Throws where the frames are too small for it.
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

std::vector<ParameterSlot> NetworkShape::Slots() const {
  ParameterSlots slots;
  if (has_encoder()) slots.Append(EncoderSlots(config, frame_size));
  slots.Append(mlp.Slots());
  return slots.Take();
}

NetworkShape ActorShape(const NetworkConfig& config, int frame_size, int num_outputs) {
  return BodyShape(config, frame_size, num_outputs);
}

NetworkShape CriticShape(const NetworkConfig& config, int frame_size, int num_outputs) {
  NetworkShape shape = BodyShape(config, frame_size, num_outputs);
  shape.mlp.num_extra = env::kActionSize;
  shape.mlp.extra_layer = shape.mlp.num_encoder_layers;
  shape.mlp.layer_norm = config.layer_norm;
  return shape;
}

void InitialiseParameters(const NetworkShape& shape, base::Random& random,
                          std::span<float> parameters) {
  InitialiseParameters(shape.Slots(), random, parameters);
}

}  // namespace slalom::nn
