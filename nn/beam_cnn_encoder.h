#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <vector>

#include "nn/encoder.h"
#include "nn/encoder_slots.h"
#include "nn/network_shape.h"

namespace slalom::nn {

/// Convolutions along the beams, the frames of the stack as channels; then a linear layer that
/// reads all of what they give with the state numbers of the frames behind it. ReLU after each. In
/// the manner of Long et al. 2018 ("Towards Optimally Decentralized Multi-Robot Collision Avoidance
/// via Deep Reinforcement Learning"): first 5 beams wide, then 3, every second beam.
///
/// Sample by sample, positions before channels, so that a window lies in one piece and is read
/// where it lies.
class BeamCnnEncoder : public Encoder {
 public:
  BeamCnnEncoder(const NetworkShape& shape, const at::Tensor& parameters);
  static std::unique_ptr<EncoderPass> MakePass(const NetworkShape& shape,
                                               const EncoderPorts& ports);

  void Forward(EncoderPass& pass) const override;
  void ParameterGradient(EncoderPass& pass, Encoder& gradient) const override;

 private:
  struct Layer {
    at::Tensor weight, bias;       // [O, width * I] or [O, I], [O]
    std::vector<at::Tensor> taps;  // [O, I] each, columns of the weight, by the beam of a window
  };

  std::vector<Layer> convolutions_;
  Layer linear_;
};

}  // namespace slalom::nn
