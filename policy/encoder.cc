#include "policy/encoder.h"

#include "base/check.h"

namespace slalom::policy {

std::unique_ptr<Encoder> MakeEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  SLALOM_CHECK_EQ(parameters.dim(), 1);
  SLALOM_CHECK(!shape.has_encoder());
  return nullptr;
}

std::unique_ptr<EncoderPass> MakeEncoderPass(const NetworkShape& shape, const EncoderPorts& ports) {
  SLALOM_CHECK(ports.features.defined());
  SLALOM_CHECK(!shape.has_encoder());
  return nullptr;
}

}  // namespace slalom::policy
