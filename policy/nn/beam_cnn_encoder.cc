#include <ATen/ATen.h>
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "env/observation.h"
#include "policy/nn/encoder.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `H` frames of `F` numbers, the first `R` of them ranges; `L` positions of `C`
/// channels after a convolution, `P` before it.

namespace slalom::nn {
namespace {

/// Convolutions along the beams, the frames of the stack as channels; then a linear layer that
/// reads all their outputs, with the state numbers of the frames behind them. ReLU after each. In
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

/// One convolution of one sample: views.
struct SamplePass {
  at::Tensor windows;                     // [L, width * I], overlapping views of the input
  at::Tensor output;                      // [L, C]
  at::Tensor output_gradient;             // [L, C]
  std::vector<at::Tensor> tap_gradients;  // [L, I] each, rows of the input's gradient
};

struct BeamCnnPass : EncoderPass {
  at::Tensor frames;                            // [B, R, H], a turned view of the encoder's input
  at::Tensor channels;                          // [B, R, H], dense
  at::Tensor states;                            // [B, H, S], a view of the encoder's input
  at::Tensor state_copy;                        // [B, H, S], a view of `flat`
  std::vector<std::vector<SamplePass>> layers;  // [convolutions][B]
  std::vector<at::Tensor> outputs;              // [B, L * C] each, rows may lie further apart
  std::vector<at::Tensor> output_gradients;     // As `outputs`.
  at::Tensor flat;                              // [B, L * C + H * S], inputs of the linear layer
  at::Tensor features, feature_gradient;        // [B, W]
};

/// [rows, columns] of the memory at `t`'s first number.
at::Tensor Strided(const at::Tensor& t, std::int64_t rows, std::int64_t columns,
                   std::int64_t stride, std::int64_t offset = 0) {
  return t.as_strided({rows, columns}, {stride, 1}, t.storage_offset() + offset);
}

std::unique_ptr<EncoderPass> BeamCnnEncoder::MakePass(const NetworkShape& shape,
                                                      const EncoderPorts& ports) {
  const std::vector<BeamConvolution> sizes = BeamConvolutions(shape.config, shape.frame_size);
  const std::int64_t batch = ports.input.size(0);
  const std::int64_t history = shape.config.history;
  const std::int64_t ranges = sizes.front().in_positions;
  const bool training = ports.use == PassUse::kTraining;
  const auto allocate = [&](at::IntArrayRef shape_of) {
    return at::zeros(shape_of, ports.input.options());
  };
  auto pass = std::make_unique<BeamCnnPass>();
  const at::Tensor stack = ports.input.as_strided({batch, history, shape.frame_size},
                                                  {ports.input.stride(0), shape.frame_size, 1},
                                                  ports.input.storage_offset());
  pass->frames = stack.narrow(2, 0, ranges).transpose(1, 2);
  pass->channels = allocate({batch, ranges, history});
  pass->states = stack.narrow(2, ranges, env::kStateSize);
  const std::int64_t flat =
      static_cast<std::int64_t>(sizes.back().out_positions) * sizes.back().out_channels;
  pass->flat = allocate({batch, flat + history * env::kStateSize});
  pass->state_copy = pass->flat.as_strided({batch, history, env::kStateSize},
                                           {pass->flat.size(1), env::kStateSize, 1}, flat);
  at::Tensor input = pass->channels.view({batch, ranges * history});
  at::Tensor input_gradient;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const BeamConvolution& size = sizes[i];
    const std::int64_t numbers = static_cast<std::int64_t>(size.out_positions) * size.out_channels;
    const bool last = i + 1 == sizes.size();
    const at::Tensor output = last ? pass->flat.narrow(1, 0, flat) : allocate({batch, numbers});
    const at::Tensor gradient = training ? allocate({batch, numbers}) : at::Tensor();
    std::vector<SamplePass> samples;
    for (std::int64_t b = 0; b < batch; ++b) {
      SamplePass sample;
      sample.windows = Strided(input.select(0, b), size.out_positions,
                               size.width * size.in_channels, size.stride * size.in_channels);
      sample.output =
          Strided(output.select(0, b), size.out_positions, size.out_channels, size.out_channels);
      if (training) {
        sample.output_gradient = Strided(gradient.select(0, b), size.out_positions,
                                         size.out_channels, size.out_channels);
        for (int tap = 0; input_gradient.defined() && tap < size.width; ++tap) {
          sample.tap_gradients.push_back(Strided(input_gradient.select(0, b), size.out_positions,
                                                 size.in_channels, size.stride * size.in_channels,
                                                 tap * size.in_channels));
        }
      }
      samples.push_back(std::move(sample));
    }
    pass->layers.push_back(std::move(samples));
    pass->outputs.push_back(output);
    pass->output_gradients.push_back(gradient);
    input = output;
    input_gradient = gradient;
  }
  pass->features = ports.features;
  pass->feature_gradient = ports.feature_gradient;
  return pass;
}

BeamCnnEncoder::BeamCnnEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  const ParameterViews views(EncoderSlots(shape.config, shape.frame_size), parameters);
  const std::vector<BeamConvolution> sizes = BeamConvolutions(shape.config, shape.frame_size);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    Layer layer{.weight = views[fmt::format("encoder.{}.weight", i)].flatten(1),
                .bias = views[fmt::format("encoder.{}.bias", i)],
                .taps = {}};
    for (int tap = 0; tap < sizes[i].width; ++tap) {
      layer.taps.push_back(
          layer.weight.narrow(1, tap * sizes[i].in_channels, sizes[i].in_channels));
    }
    convolutions_.push_back(std::move(layer));
  }
  const std::size_t last = sizes.size();
  const at::Tensor weight = views[fmt::format("encoder.{}.weight", last)];
  const std::int64_t flat =
      static_cast<std::int64_t>(sizes.back().out_positions) * sizes.back().out_channels;
  linear_ = {.weight = weight,
             .bias = views[fmt::format("encoder.{}.bias", last)],
             .taps = {weight.narrow(1, 0, flat)}};
}

void BeamCnnEncoder::Forward(EncoderPass& encoder_pass) const {
  BeamCnnPass& pass = static_cast<BeamCnnPass&>(encoder_pass);
  pass.channels.copy_(pass.frames);
  pass.state_copy.copy_(pass.states);
  for (std::size_t i = 0; i < convolutions_.size(); ++i) {
    const Layer& layer = convolutions_[i];
    for (SamplePass& sample : pass.layers[i]) {
      Linear(sample.windows, layer.weight, layer.bias, /*relu=*/true, sample.output);
    }
  }
  Linear(pass.flat, linear_.weight, linear_.bias, /*relu=*/true, pass.features);
}

void BeamCnnEncoder::ParameterGradient(EncoderPass& encoder_pass, Encoder& encoder_gradient) const {
  BeamCnnPass& pass = static_cast<BeamCnnPass&>(encoder_pass);
  BeamCnnEncoder& gradient = static_cast<BeamCnnEncoder&>(encoder_gradient);
  ReluGradient(pass.features, pass.feature_gradient);
  LinearWeightGradient(pass.flat, pass.feature_gradient, gradient.linear_.weight,
                       gradient.linear_.bias);
  LinearInputGradient(pass.feature_gradient, linear_.taps[0], pass.outputs.back(),
                      pass.output_gradients.back());
  for (std::size_t i = convolutions_.size(); i-- > 0;) {
    const Layer& layer = convolutions_[i];
    Layer& result = gradient.convolutions_[i];
    if (i > 0) pass.output_gradients[i - 1].zero_();
    for (std::size_t b = 0; b < pass.layers[i].size(); ++b) {
      SamplePass& sample = pass.layers[i][b];
      LinearWeightGradient(sample.windows, sample.output_gradient, result.weight, result.bias,
                           b == 0 ? Into::kReplace : Into::kAdd);
      for (std::size_t tap = 0; tap < sample.tap_gradients.size(); ++tap) {
        LinearInputGradient(sample.output_gradient, layer.taps[tap], {}, sample.tap_gradients[tap],
                            Into::kAdd);
      }
    }
    if (i > 0) ReluGradient(pass.outputs[i - 1], pass.output_gradients[i - 1]);
  }
}

}  // namespace

template <>
std::unique_ptr<Encoder> MakeEncoderOf<EncoderKind::kBeamCnn>(const NetworkShape& shape,
                                                              const at::Tensor& parameters) {
  return std::make_unique<BeamCnnEncoder>(shape, parameters);
}

template <>
std::unique_ptr<EncoderPass> MakeEncoderPassOf<EncoderKind::kBeamCnn>(const NetworkShape& shape,
                                                                      const EncoderPorts& ports) {
  return BeamCnnEncoder::MakePass(shape, ports);
}

}  // namespace slalom::nn
