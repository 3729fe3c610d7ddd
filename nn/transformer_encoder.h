#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <vector>

#include "nn/encoder.h"
#include "nn/network_shape.h"

namespace slalom::nn {

/// The body of GPT-2 (Radford et al. 2019) over the frames, as the original's: frames embedded
/// linearly, a learned vector for each place in the stack added, LayerNorm; causal blocks, each
/// LayerNorm and attention, then LayerNorm and a GELU layer of four times the width; LayerNorm. The
/// features are those of the newest frame.
///
/// As nothing else of the last block is looked at, it asks for the newest frame alone.
class TransformerEncoder : public Encoder {
 public:
  TransformerEncoder(const NetworkShape& shape, const at::Tensor& parameters);
  static std::unique_ptr<EncoderPass> MakePass(const NetworkShape& shape,
                                               const EncoderPorts& ports);

  void Forward(EncoderPass& pass) const override;
  void ParameterGradient(EncoderPass& pass, Encoder& gradient) const override;

 private:
  struct Norm {
    at::Tensor gain, bias;  // [W]
  };
  struct Layer {
    at::Tensor weight, bias;  // [O, I], [O]
  };
  struct Block {
    Norm attention_norm;
    Layer query, key_value, query_key_value;  // Rows of one weight: [W], [2 W] and all [3 W].
    Layer output;
    Norm mlp_norm;
    Layer up, down;
  };
  struct BlockPass;
  struct Pass;

  void ForwardBlock(const Block& block, BlockPass& pass) const;
  void BlockGradient(const Block& block, BlockPass& pass, Block& gradient) const;

  Layer embedding_;
  at::Tensor time_;  // [H * W]
  Norm embedding_norm_;
  std::vector<Block> blocks_;
  Norm norm_;
};

}  // namespace slalom::nn
