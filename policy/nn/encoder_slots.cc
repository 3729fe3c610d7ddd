#include "policy/nn/encoder_slots.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"

namespace slalom::nn {

void RefuseLayers(const NetworkConfig& config, std::string_view expected) {
  throw base::Error("network.encoder_layers: found [{}] with encoder \"{}\", expected {}",
                    fmt::join(config.encoder_layers, ", "), base::EnumName(config.encoder),
                    expected);
}

void CheckNetwork(const NetworkConfig& config) {
  const EncoderKind kind = EncoderOf(config);
  if (kind == EncoderKind::kMlp) return;
  DispatchEncoder(kind, [&]<EncoderKind kKind>() { CheckEncoder<kKind>(config); });
}

std::vector<ParameterSlot> EncoderSlots(const NetworkConfig& config, int frame_size) {
  return DispatchEncoder(EncoderOf(config), [&]<EncoderKind kKind>() {
    return EncoderSlotsOf<kKind>(config, frame_size);
  });
}

}  // namespace slalom::nn
