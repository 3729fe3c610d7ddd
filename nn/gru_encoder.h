#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <vector>

#include "nn/encoder.h"
#include "nn/network_shape.h"

namespace slalom::nn {

/// Gated recurrent units, layer upon layer, from a state of zeros over the frames, oldest first;
/// the features are the last layer's last state (`GruStep`).
///
/// The inputs' products of all steps are one product wherever they lie in one piece.
class GruEncoder : public Encoder {
 public:
  GruEncoder(const NetworkShape& shape, const at::Tensor& parameters);
  static std::unique_ptr<EncoderPass> MakePass(const NetworkShape& shape,
                                               const EncoderPorts& ports);

  void Forward(EncoderPass& pass) const override;
  void ParameterGradient(EncoderPass& pass, Encoder& gradient) const override;

 private:
  struct Layer {
    at::Tensor input_weight;  // [3 W, I]
    at::Tensor input_bias;    // [3 W]
    at::Tensor state_weight;  // [3 W, W]
    at::Tensor state_bias;    // [3 W]
  };

  std::vector<Layer> layers_;
};

}  // namespace slalom::nn
