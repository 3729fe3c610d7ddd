#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "policy/nn/parameter_slot.h"

namespace slalom::nn {

/// The sizes of a fully connected network: ReLU layers, then a linear one. A value.
///
/// All parameters lie in one flat array, layer by layer: weight [O, I], bias [O] and, in hidden
/// layers with LayerNorm, gain [O], bias [O]. Layer `extra_layer` reads `num_extra` more inputs (a
/// critic's action) behind those of the layer before it.
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

}  // namespace slalom::nn
