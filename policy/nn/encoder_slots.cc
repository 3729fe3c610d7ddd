#include "policy/nn/encoder_slots.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"

namespace slalom::nn {

void RefuseLayers(const NetworkConfig& config, std::string_view expected) {
  throw base::Error(fmt::format(
      "network.encoder_layers: found [{}] with encoder \"{}\", expected {}",
      fmt::join(config.encoder_layers, ", "), base::EnumName(config.encoder), expected));
}

void CheckNetwork(const NetworkConfig& config) {
  const EncoderKind kind = EncoderOf(config);
  if (config.cnn_axis == CnnAxis::kBeams && kind != EncoderKind::kBeamCnn) {
    throw base::Error(fmt::format(
        "network.cnn_axis: found \"beams\" with encoder \"{}\", expected encoder \"cnn\"",
        base::EnumName(config.encoder)));
  }
  if (kind != EncoderKind::kTransformer && (config.dropout > 0.0 || config.dropout_everywhere)) {
    throw base::Error(fmt::format(
        "network.dropout: found {}, everywhere = {}, with encoder \"{}\", expected encoder "
        "\"transformer\", which alone has dropout",
        config.dropout, config.dropout_everywhere, base::EnumName(config.encoder)));
  }
  if (kind == EncoderKind::kMlp) return;
  DispatchEncoder(kind, [&]<EncoderKind kKind>() { CheckEncoder<kKind>(config); });
}

std::vector<ParameterSlot> EncoderSlots(const NetworkConfig& config, int frame_size) {
  return DispatchEncoder(EncoderOf(config), [&]<EncoderKind kKind>() {
    return EncoderSlotsOf<kKind>(config, frame_size);
  });
}

}  // namespace slalom::nn
