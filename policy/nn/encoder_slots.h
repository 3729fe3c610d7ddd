#pragma once

#include <string_view>
#include <vector>

#include "policy/nn/network_config.h"
#include "policy/nn/parameter_slot.h"

/// The parameters of encoders other than "mlp"; docs/networks.md has the formulas.

namespace slalom::nn {

/// Throws `base::Error` that names the key if `config` makes no network.
void CheckNetwork(const NetworkConfig& config);

/// The encoder's parameters, named "encoder...". Requires: an encoder other than "mlp".
/// Throws `base::Error` if frames of `frame_size` numbers are too small for it.
std::vector<ParameterSlot> EncoderSlots(const NetworkConfig& config, int frame_size);

/// The two functions above for one kind, defined in the source of that encoder in
/// policy/nn/inference/.
template <EncoderKind kKind>
void CheckEncoder(const NetworkConfig& config);
template <EncoderKind kKind>
std::vector<ParameterSlot> EncoderSlotsOf(const NetworkConfig& config, int frame_size);

#define SLALOM_DECLARE(kind)                                  \
  template <>                                                 \
  void CheckEncoder<EncoderKind::kind>(const NetworkConfig&); \
  template <>                                                 \
  std::vector<ParameterSlot> EncoderSlotsOf<EncoderKind::kind>(const NetworkConfig&, int);
SLALOM_FOR_EACH_ENCODER(SLALOM_DECLARE)
#undef SLALOM_DECLARE

/// Throws `base::Error` that network.encoder_layers are not as `expected`.
[[noreturn]] void RefuseLayers(const NetworkConfig& config, std::string_view expected);

/// One convolution over beams.
struct BeamConvolution {
  int width;        ///< Number of beams that one output reads.
  int stride;       ///< Beams from one output to the next.
  int in_channels;  ///< Frames, or the numbers of the layer before.
  int out_channels;
  int in_positions;
  int out_positions;  ///< floor((in_positions - width) / stride) + 1
};

/// The convolutions of an encoder "cnn" over beams, first to last. Throws as `EncoderSlots`.
std::vector<BeamConvolution> BeamConvolutions(const NetworkConfig& config, int frame_size);

}  // namespace slalom::nn
