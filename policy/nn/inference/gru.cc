#include <fmt/format.h>

#include <algorithm>

#include "policy/nn/encoder_slots.h"
#include "policy/nn/inference/inference_encoder.h"
#include "policy/nn/inference/layers.h"

/// Gated recurrent units, without LibTorch; policy/nn/gru_encoder.cc trains them.
///
/// Shapes: `B` batch, `H` steps, `I` inputs and `W` width of a layer. Rows of all steps lie step
/// after step.

namespace slalom::nn {

template <>
void CheckEncoder<EncoderKind::kGru>(const NetworkConfig& config) {
  if (config.encoder_layers.empty()) RefuseLayers(config, "one width or more");
}

template <>
std::vector<ParameterSlot> EncoderSlotsOf<EncoderKind::kGru>(const NetworkConfig& config,
                                                             int frame_size) {
  ParameterSlots slots;
  std::int64_t inputs = frame_size;
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    const std::int64_t width = config.encoder_layers[i];
    const InitialValues initial = InitialValues::Uniform(width);
    const std::string layer = fmt::format("encoder.{}.", i);
    slots.Add(layer + "input.weight", {3 * width, inputs}, initial);
    slots.Add(layer + "input.bias", {3 * width}, initial);
    slots.Add(layer + "state.weight", {3 * width, width}, initial);
    slots.Add(layer + "state.bias", {3 * width}, initial);
    inputs = width;
  }
  return slots.Take();
}

namespace {

class Gru : public InferenceEncoder {
 public:
  Gru(const NetworkShape& shape, const std::vector<ParameterSlot>& slots, const CpuFeatures& cpu)
      : history_(shape.config.history), frame_(shape.frame_size) {
    for (std::size_t i = 0; i < shape.config.encoder_layers.size(); ++i) {
      const std::string name = fmt::format("encoder.{}.", i);
      layers_.push_back({.input = NamedLinear(slots, name + "input", cpu),
                         .state = NamedLinear(slots, name + "state", cpu),
                         .state_bias = NamedVector(slots, name + "state.bias"),
                         .gates = {},
                         .states = {}});
    }
  }

  void SetWeights(const float* parameters) override {
    for (Layer& layer : layers_) {
      layer.input.SetWeights(parameters);
      layer.state.SetWeights(parameters);
      layer.state_bias.SetWeights(parameters);
    }
  }

  void Resize(std::int64_t batch) override {
    batch_ = batch;
    std::int64_t widest = 0;
    for (Layer& layer : layers_) {
      layer.gates.Resize(history_ * batch, layer.input->outputs());
      layer.states.Resize((history_ + 1) * batch, layer.state->inputs());
      widest = std::max(widest, layer.input->outputs());
    }
    state_gates_.Resize(batch, widest);
  }

  void Forward(Rows input, base::Random* /*dropout*/, Rows features) override {
    for (std::size_t i = 0; i < layers_.size(); ++i) {
      Layer& layer = layers_[i];
      if (i == 0) {
        for (std::int64_t t = 0; t < history_; ++t) {
          layer.input->Forward(batch_, input.From(0, t * frame_), /*relu=*/false,
                               layer.gates.rows().From(t * batch_, 0));
        }
      } else {
        layer.input->Forward(history_ * batch_, layers_[i - 1].states.rows().From(batch_, 0),
                             /*relu=*/false, layer.gates.rows());
      }
      for (std::int64_t t = 0; t < history_; ++t) {
        const bool is_output = i + 1 == layers_.size() && t + 1 == history_;
        Step(layer, t, is_output ? features : layer.states.rows().From((t + 1) * batch_, 0));
      }
    }
  }

 private:
  struct Layer {
    NamedLinear input;       // [3 W, I]
    NamedLinear state;       // [3 W, W]
    NamedVector state_bias;  // [3 W]
    Buffer gates;            // [H * B, 3 W]
    Buffer states;           // [(H + 1) * B, W], before each step; the first are zeros
  };

  /// Writes the state `after` step t, [B, W].
  void Step(Layer& layer, std::int64_t t, Rows after) {
    const std::int64_t width = layer.state->inputs();
    const Rows before = layer.states.rows().From(t * batch_, 0);
    const Rows state_gates = {state_gates_.data(), 3 * width};
    if (t == 0) {
      // The product with a state of zeros is the bias.
      for (std::int64_t b = 0; b < batch_; ++b) {
        std::copy_n(layer.state_bias.data(), 3 * width, state_gates[b]);
      }
    } else {
      layer.state->Forward(batch_, before, /*relu=*/false, state_gates);
    }
    GruStepRows({batch_, width}, before, state_gates, layer.gates.rows().From(t * batch_, 0),
                after);
  }

  std::int64_t history_;
  std::int64_t frame_;
  std::vector<Layer> layers_;
  std::int64_t batch_ = 0;
  Buffer state_gates_;  // [B, 3 W] of the widest
};

}  // namespace

template <>
std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf<EncoderKind::kGru>(
    const NetworkShape& shape, const CpuFeatures& cpu) {
  return std::make_unique<Gru>(shape, EncoderSlots(shape.config, shape.frame_size), cpu);
}

}  // namespace slalom::nn
