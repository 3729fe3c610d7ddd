#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/random.h"
#include "env/action.h"
#include "policy/nn/network_config.h"
#include "policy/nn/parameter_slot.h"

/// Shapes: `H` frames of history, `F` features of a frame, `W` features that an encoder gives.

namespace slalom::nn {

/// The sizes of a fully connected network: ReLU layers, then a linear one. A value.
///
/// All parameters lie in one flat array, layer by layer: weight [O, I], bias [O] and, in hidden
/// layers with LayerNorm, gain [O], bias [O]. Layer `extra_layer` reads `num_extra` more inputs (a
/// critic's action) behind the outputs of the layer before it.
struct MlpShape {
  int num_inputs = 0;
  std::vector<int> hidden;     ///< Widths of the ReLU layers, encoder then head.
  int num_encoder_layers = 0;  ///< Layers named "encoder.I"; the others are named "head.I".
  int num_outputs = 0;
  int num_extra = 0;
  int extra_layer = 0;  ///< In 0 .. num_layers() - 1; unused if num_extra is 0.
  bool layer_norm = false;

  int num_layers() const { return static_cast<int>(hidden.size()) + 1; }
  int layer_inputs(int layer) const;  ///< Includes the extra inputs.
  int layer_outputs(int layer) const;
  std::string layer_name(int layer) const;  ///< Prefix of parameters: "encoder.0", "head.1".
  std::vector<ParameterSlot> Slots() const;
  std::int64_t num_parameters() const { return CountParameters(Slots()); }
};

/// The sizes of a network: an encoder that reads the stack of frames, and a head. A value.
///
/// Encoder "mlp" has no encoder of its own: its layers are the first of `mlp`, which reads the
/// stack itself. With any other, `mlp` is the head, which reads the encoder's features with the
/// extra inputs behind them. All parameters lie in one flat array, the encoder's first.
struct NetworkShape {
  NetworkConfig config;
  EncoderKind encoder = EncoderKind::kMlp;  ///< The encoder that `config` names.
  int frame_size = 0;                       ///< F
  MlpShape mlp;

  int num_inputs() const {
    return config.history * frame_size;
  }  ///< H * F, without the extra inputs.
  int num_outputs() const { return mlp.num_outputs; }
  int num_extra() const { return mlp.num_extra; }
  /// Whether `mlp` is a head behind an encoder of its own.
  bool has_encoder() const { return encoder != EncoderKind::kMlp; }
  std::vector<ParameterSlot> Slots() const;
  std::int64_t num_parameters() const { return CountParameters(Slots()); }
};

/// Actor: features [H * F] -> outputs, before tanh. The paper's at H = 1: 1,160,194 parameters.
/// Throws `base::Error` that names the key if the config makes no network.
NetworkShape ActorShape(const NetworkConfig& config, int frame_size,
                        int num_outputs = env::kActionSize);

/// Critic and transition model: features [H * F] and action [A] -> outputs. Throws as `ActorShape`.
NetworkShape CriticShape(const NetworkConfig& config, int frame_size, int num_outputs = 1,
                         int action_size = env::kActionSize);

/// Sets every parameter to its initial value, by its slot: LibTorch's defaults, with the exceptions
/// in docs/networks.md. `parameters`: [shape.num_parameters()].
void InitialiseParameters(const NetworkShape& shape, base::Random& random,
                          std::span<float> parameters);

}  // namespace slalom::nn
