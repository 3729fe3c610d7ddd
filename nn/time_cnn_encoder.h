#pragma once

#include <ATen/core/Tensor.h>

#include <memory>

#include "nn/encoder.h"
#include "nn/network_shape.h"

namespace slalom::nn {

/// Convolutions along time, as the original's: the numbers of a frame are channels. The first sees
/// three frames, with zeros before the oldest and behind the newest, the second all H; ReLU after
/// each.
///
/// A window of frames lies in one piece in the stack, so each is a product by itself, without a
/// copy; what lies beyond the stack is left out instead of multiplied by zero.
class TimeCnnEncoder : public Encoder {
 public:
  TimeCnnEncoder(const NetworkShape& shape, const at::Tensor& parameters);
  static std::unique_ptr<EncoderPass> MakePass(const NetworkShape& shape,
                                               const EncoderPorts& ports);

  void Forward(EncoderPass& pass) const override;
  void ParameterGradient(EncoderPass& pass, Encoder& gradient) const override;

 private:
  std::vector<at::Tensor>
      window_weights_;        // [V, (up to 3) * F] of each place: columns of one weight
  at::Tensor first_weight_;   // [V, 3 * F], all of it
  at::Tensor first_bias_;     // [V]
  at::Tensor second_weight_;  // [W, H * V]
  at::Tensor second_bias_;    // [W]
};

}  // namespace slalom::nn
