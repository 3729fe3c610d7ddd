#include "nn/encoder.h"

#include "base/check.h"
#include "nn/beam_cnn_encoder.h"
#include "nn/gru_encoder.h"
#include "nn/time_cnn_encoder.h"
#include "nn/transformer_encoder.h"

namespace slalom::nn {
namespace {

/// Calls `make` with the class that `shape` asks for, as a null pointer to it.
template <class Make>
auto Dispatch(const NetworkShape& shape, const Make& make) {
  SLALOM_CHECK(shape.has_encoder());
  if (shape.config.encoder == "gru") return make(static_cast<GruEncoder*>(nullptr));
  if (shape.config.encoder == "transformer") {
    return make(static_cast<TransformerEncoder*>(nullptr));
  }
  if (shape.config.cnn_axis == "beams") return make(static_cast<BeamCnnEncoder*>(nullptr));
  return make(static_cast<TimeCnnEncoder*>(nullptr));
}

}  // namespace

std::unique_ptr<Encoder> MakeEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  return Dispatch(shape, [&]<class Kind>(Kind*) -> std::unique_ptr<Encoder> {
    return std::make_unique<Kind>(shape, parameters);
  });
}

std::unique_ptr<EncoderPass> MakeEncoderPass(const NetworkShape& shape, const EncoderPorts& ports) {
  return Dispatch(shape, [&]<class Kind>(Kind*) { return Kind::MakePass(shape, ports); });
}

}  // namespace slalom::nn
