#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/random.h"
#include "policy/network_config.h"

namespace slalom::policy {

/// One parameter tensor in a network's flat parameters.
struct ParameterSlot {
  std::string name;                 ///< "encoder.0.weight"
  std::int64_t offset = 0;          ///< Of its first number.
  std::vector<std::int64_t> shape;  ///< Row-major: [outputs, inputs] or [outputs].
  int fan_in = 0;                   ///< Inputs of its layer; 0 for LayerNorm's gain and bias.

  std::int64_t size() const;
};

/// The sizes of a fully connected network: ReLU layers, then a linear one. A value.
///
/// All parameters lie in one flat array, layer by layer: weight [O, I], bias [O] and, in hidden
/// layers with LayerNorm, gain [O], bias [O]. Layer `extra_layer` reads `num_extra` more inputs (a
/// critic's action) behind those of the layer before it.
struct MlpShape {
  int num_inputs = 0;
  std::vector<int> hidden;  ///< Widths of the ReLU layers, encoder then head.
  int num_encoder_layers = 0;
  int num_outputs = 0;
  int num_extra = 0;
  int extra_layer = 0;  ///< In 0 .. num_layers() - 1; of no meaning where num_extra is 0.
  bool layer_norm = false;

  int num_layers() const { return static_cast<int>(hidden.size()) + 1; }
  int layer_inputs(int layer) const;  ///< With the extra ones.
  int layer_outputs(int layer) const;
  std::vector<ParameterSlot> Slots() const;
  std::int64_t num_parameters() const;
};

/// Actor: features [H * F] -> 2, before tanh. The paper's at H = 1: 1,160,194 parameters. A
/// stochastic one has 4 outputs.
MlpShape ActorShape(const NetworkConfig& config, int frame_size, int num_outputs = 2);

/// Critic: features [H * F] and action [2] -> 1.
MlpShape CriticShape(const NetworkConfig& config, int frame_size);

/// LibTorch's default for linear layers: weights and biases uniform in +-1 / sqrt(fan_in);
/// LayerNorm 1 and 0. `parameters`: [shape.num_parameters()].
void InitialiseParameters(const MlpShape& shape, base::Random& random, std::span<float> parameters);

}  // namespace slalom::policy
