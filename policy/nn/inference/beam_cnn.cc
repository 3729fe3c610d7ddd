#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"
#include "env/observation.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/inference/inference_encoder.h"
#include "policy/nn/inference/layers.h"

/// Convolutions along the beams, without LibTorch; policy/nn/beam_cnn_encoder.cc trains them.
///
/// Shapes: `B` batch, `H` frames of `F` numbers, the first `R` of them ranges and `S` of the state;
/// `L` positions of `C` channels after a convolution, `I` channels before it.

namespace slalom::nn {

template <>
void CheckEncoder<EncoderKind::kBeamCnn>(const NetworkConfig& config) {
  if (config.encoder_layers.size() < 2) {
    RefuseLayers(config, "the channels of one convolution or more and a width");
  }
}

template <>
std::vector<ParameterSlot> EncoderSlotsOf<EncoderKind::kBeamCnn>(const NetworkConfig& config,
                                                                 int frame_size) {
  ParameterSlots slots;
  const std::vector<BeamConvolution> layers = BeamConvolutions(config, frame_size);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const BeamConvolution& layer = layers[i];
    const InitialValues initial = InitialValues::Uniform(layer.width * layer.in_channels);
    slots.Add(fmt::format("encoder.{}.weight", i),
              {layer.out_channels, layer.width, layer.in_channels}, initial);
    slots.Add(fmt::format("encoder.{}.bias", i), {layer.out_channels}, initial);
  }
  const BeamConvolution& last = layers.back();
  slots.AddLinear(fmt::format("encoder.{}", layers.size()), config.encoder_layers.back(),
                  static_cast<std::int64_t>(last.out_positions) * last.out_channels +
                      config.history * env::kStateSize);
  return slots.Take();
}

std::vector<BeamConvolution> BeamConvolutions(const NetworkConfig& config, int frame_size) {
  std::vector<BeamConvolution> layers;
  int positions = frame_size - env::kStateSize;
  int channels = config.history;
  for (std::size_t i = 0; i + 1 < config.encoder_layers.size(); ++i) {
    BeamConvolution layer{.width = i == 0 ? 5 : 3,
                          .stride = 2,
                          .in_channels = channels,
                          .out_channels = config.encoder_layers[i],
                          .in_positions = positions,
                          .out_positions = 0};
    base::ThrowIf(
        positions < layer.width,
        "network.encoder_layers: found [{}] over {} ranges, of which convolution {} gets {}, "
        "expected {} or more; fewer convolutions or more sectors",
        fmt::join(config.encoder_layers, ", "), frame_size - env::kStateSize, i + 1, positions,
        layer.width);
    layer.out_positions = (positions - layer.width) / layer.stride + 1;
    positions = layer.out_positions;
    channels = layer.out_channels;
    layers.push_back(layer);
  }
  return layers;
}

namespace {

class BeamCnn : public InferenceEncoder {
 public:
  BeamCnn(const NetworkShape& shape, const std::vector<ParameterSlot>& slots,
          const CpuFeatures& cpu)
      : history_(shape.config.history),
        frame_(shape.frame_size),
        sizes_(BeamConvolutions(shape.config, shape.frame_size)),
        linear_(slots, fmt::format("encoder.{}", sizes_.size()), cpu) {
    for (std::size_t i = 0; i < sizes_.size(); ++i) {
      convolutions_.emplace_back(slots, fmt::format("encoder.{}", i), cpu);
    }
    outputs_.resize(sizes_.size());
  }

  void SetWeights(const float* parameters) override {
    for (NamedLinear& convolution : convolutions_) convolution.SetWeights(parameters);
    linear_.SetWeights(parameters);
  }

  void Resize(std::int64_t batch) override {
    batch_ = batch;
    channels_.Resize(1, sizes_.front().in_positions * history_);
    for (std::size_t i = 0; i + 1 < sizes_.size(); ++i) outputs_[i].Resize(1, Numbers(sizes_[i]));
    flat_.Resize(batch, Numbers(sizes_.back()) + history_ * env::kStateSize);
  }

  void Forward(Rows input, base::Random* /*dropout*/, Rows features) override {
    for (std::int64_t b = 0; b < batch_; ++b) Convolve(input[b], flat_.rows()[b]);
    linear_->Forward(batch_, flat_.rows(), /*relu=*/true, features);
  }

 private:
  static std::int64_t Numbers(const BeamConvolution& size) {
    return static_cast<std::int64_t>(size.out_positions) * size.out_channels;
  }

  /// Writes the linear layer's inputs for one sample: [L * C + H * S]. frames: [H, F].
  void Convolve(const float* frames, float* flat) {
    const std::int64_t ranges = sizes_.front().in_positions;
    float* const channels = channels_.data();
    for (std::int64_t t = 0; t < history_; ++t) {
      const float* const frame = frames + t * frame_;
      for (std::int64_t i = 0; i < ranges; ++i) channels[i * history_ + t] = frame[i];
      std::copy_n(frame + ranges, env::kStateSize,
                  flat + Numbers(sizes_.back()) + t * env::kStateSize);
    }
    float* in = channels;
    for (std::size_t i = 0; i < sizes_.size(); ++i) {
      const BeamConvolution& size = sizes_[i];
      float* const out = i + 1 == sizes_.size() ? flat : outputs_[i].data();
      // A window lies in one piece and is read where it lies.
      const std::int64_t stride = static_cast<std::int64_t>(size.stride) * size.in_channels;
      convolutions_[i]->Forward(size.out_positions, {in, stride}, /*relu=*/true,
                                {out, size.out_channels});
      in = out;
    }
  }

  std::int64_t history_;
  std::int64_t frame_;
  std::vector<BeamConvolution> sizes_;
  std::vector<NamedLinear> convolutions_;
  NamedLinear linear_;
  std::int64_t batch_ = 0;
  Buffer channels_;              // [R, H], of one sample
  std::vector<Buffer> outputs_;  // [L, C] each, of one sample; the last lie in `flat_`
  Buffer flat_;                  // [B, L * C + H * S]
};

}  // namespace

template <>
std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf<EncoderKind::kBeamCnn>(
    const NetworkShape& shape, const CpuFeatures& cpu) {
  return std::make_unique<BeamCnn>(shape, EncoderSlots(shape.config, shape.frame_size), cpu);
}

}  // namespace slalom::nn
