#include "policy/nn/mlp_shape.h"

#include <fmt/format.h>

namespace slalom::nn {

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

}  // namespace slalom::nn
