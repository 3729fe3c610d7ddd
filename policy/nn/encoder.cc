#include "policy/nn/encoder.h"

namespace slalom::nn {

std::unique_ptr<Encoder> MakeEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  return DispatchEncoder(
      shape.encoder, [&]<EncoderKind kKind>() { return MakeEncoderOf<kKind>(shape, parameters); });
}

std::unique_ptr<EncoderPass> MakeEncoderPass(const NetworkShape& shape, const EncoderPorts& ports) {
  return DispatchEncoder(
      shape.encoder, [&]<EncoderKind kKind>() { return MakeEncoderPassOf<kKind>(shape, ports); });
}

}  // namespace slalom::nn
