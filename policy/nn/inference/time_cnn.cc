#include <algorithm>

#include "policy/nn/encoder_slots.h"
#include "policy/nn/inference/inference_encoder.h"
#include "policy/nn/inference/layers.h"

/// Convolutions along time, without LibTorch; policy/nn/time_cnn_encoder.cc trains them.
///
/// Shapes: `B` batch, `H` frames of `F` numbers, `V` and `W` channels after the two convolutions.

namespace slalom::nn {

template <>
void CheckEncoder<EncoderKind::kTimeCnn>(const NetworkConfig& config) {
  if (config.encoder_layers.size() != 2) {
    RefuseLayers(config, "two widths, of the convolutions over time");
  }
}

/// [O, taps, I], the frames of a window side by side.
template <>
std::vector<ParameterSlot> EncoderSlotsOf<EncoderKind::kTimeCnn>(const NetworkConfig& config,
                                                                 int frame_size) {
  constexpr int kTimeTaps = 3;
  ParameterSlots slots;
  const auto add = [&slots](const std::string& name, int outputs, int taps, int inputs) {
    const InitialValues initial = InitialValues::Uniform(taps * inputs);
    slots.Add(name + ".weight", {outputs, taps, inputs}, initial);
    slots.Add(name + ".bias", {outputs}, initial);
  };
  add("encoder.0", config.encoder_layers[0], kTimeTaps, frame_size);
  add("encoder.1", config.encoder_layers[1], config.history, config.encoder_layers[0]);
  return slots.Take();
}

namespace {

class TimeCnn : public InferenceEncoder {
 public:
  TimeCnn(const NetworkShape& shape, const std::vector<ParameterSlot>& slots,
          const CpuFeatures& cpu)
      : history_(shape.config.history),
        frame_(shape.frame_size),
        first_(slots, "encoder.0", cpu),
        second_(slots, "encoder.1", cpu) {}

  void SetWeights(const float* parameters) override {
    first_.SetWeights(parameters);
    second_.SetWeights(parameters);
  }

  void Resize(std::int64_t batch) override {
    batch_ = batch;
    hidden_.Resize(batch, history_ * first_->outputs());
  }

  void Forward(Rows input, base::Random* /*dropout*/, Rows features) override {
    for (std::int64_t t = 0; t < history_; ++t) {
      // The frames of the stack that the window around place t covers; the others are zeros.
      const std::int64_t first = std::max<std::int64_t>(0, t - 1);
      const std::int64_t count = std::min(history_, t + 2) - first;
      first_->ForwardPart(batch_, input.From(0, first * frame_), (first - (t - 1)) * frame_,
                          count * frame_, /*relu=*/true,
                          hidden_.rows().From(0, t * first_->outputs()));
    }
    second_->Forward(batch_, hidden_.rows(), /*relu=*/true, features);
  }

 private:
  std::int64_t history_;
  std::int64_t frame_;
  NamedLinear first_, second_;
  std::int64_t batch_ = 0;
  Buffer hidden_;  // [B, H * V]
};

}  // namespace

template <>
std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf<EncoderKind::kTimeCnn>(
    const NetworkShape& shape, const CpuFeatures& cpu) {
  return std::make_unique<TimeCnn>(shape, EncoderSlots(shape.config, shape.frame_size), cpu);
}

}  // namespace slalom::nn
