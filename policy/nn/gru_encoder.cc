#include <ATen/ATen.h>
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "policy/nn/encoder.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/sequence_ops.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `H` steps, `I` inputs and `W` width of a layer. Rows of all steps lie step
/// after step.

namespace slalom::nn {
namespace {

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

/// Views that one step of one layer reads and writes.
struct Step {
  at::Tensor input;           // [B, I]
  at::Tensor gates;           // [B, 3 W]
  at::Tensor state_gates;     // [B, 3 W]
  at::Tensor before;          // [B, W]
  at::Tensor after;           // [B, W]
  at::Tensor after_gradient;  // [B, W]
};

struct LayerPass {
  std::vector<Step> steps;
  at::Tensor inputs;           // [H * B, I], if they lie in one piece
  at::Tensor gates;            // [H * B, 3 W]
  at::Tensor state_gates;      // [H * B, 3 W]
  at::Tensor states;           // [(H + 1) * B, W], the first of them zeros
  at::Tensor state_gradients;  // [H * B, W], by the states after each step
  // Views without the first step, whose state before it is zero; undefined if H is 1.
  at::Tensor later_states;       // [(H - 1) * B, W], before each step
  at::Tensor later_state_gates;  // [(H - 1) * B, 3 W]
};

struct GruPass : EncoderPass {
  std::vector<LayerPass> layers;
};

std::unique_ptr<EncoderPass> GruEncoder::MakePass(const NetworkShape& shape,
                                                  const EncoderPorts& ports) {
  const std::int64_t batch = ports.input.size(0);
  const std::int64_t history = shape.config.history;
  const auto options = ports.input.options();
  auto pass = std::make_unique<GruPass>();
  for (const int width : shape.config.encoder_layers) {
    const bool first = pass->layers.empty();
    const bool last = pass->layers.size() + 1 == shape.config.encoder_layers.size();
    LayerPass layer;
    if (!first) layer.inputs = pass->layers.back().states.narrow(0, batch, history * batch);
    layer.gates = at::zeros({history * batch, 3 * width}, options);
    layer.state_gates = at::zeros_like(layer.gates);
    layer.states = at::zeros({(history + 1) * batch, width}, options);
    if (history > 1) {
      layer.later_states = layer.states.narrow(0, batch, (history - 1) * batch);
      layer.later_state_gates = layer.state_gates.narrow(0, batch, (history - 1) * batch);
    }
    if (ports.use == PassUse::kTraining) {
      layer.state_gradients = at::zeros({history * batch, width}, options);
    }
    for (std::int64_t t = 0; t < history; ++t) {
      const auto step_of = [&](const at::Tensor& all, std::int64_t step) {
        return all.defined() ? all.narrow(0, step * batch, batch) : at::Tensor();
      };
      const bool is_output = last && t + 1 == history;
      layer.steps.push_back(
          {.input = first ? ports.input.narrow(1, t * shape.frame_size, shape.frame_size)
                          : step_of(layer.inputs, t),
           .gates = step_of(layer.gates, t),
           .state_gates = step_of(layer.state_gates, t),
           .before = step_of(layer.states, t),
           .after = is_output ? ports.features : step_of(layer.states, t + 1),
           .after_gradient =
               is_output ? ports.feature_gradient : step_of(layer.state_gradients, t)});
    }
    pass->layers.push_back(std::move(layer));
  }
  return pass;
}

GruEncoder::GruEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  const ParameterViews views(EncoderSlots(shape.config, shape.frame_size), parameters);
  for (std::size_t i = 0; i < shape.config.encoder_layers.size(); ++i) {
    const auto view = [&](const char* name) {
      return views[fmt::format("encoder.{}.{}", i, name)];
    };
    layers_.push_back(
        {view("input.weight"), view("input.bias"), view("state.weight"), view("state.bias")});
  }
}

void GruEncoder::Forward(EncoderPass& encoder_pass) const {
  GruPass& pass = static_cast<GruPass&>(encoder_pass);
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const Layer& layer = layers_[i];
    LayerPass& state = pass.layers[i];
    if (state.inputs.defined()) {
      Linear(state.inputs, layer.input_weight, layer.input_bias, /*relu=*/false, state.gates);
    } else {
      for (Step& step : state.steps) {
        Linear(step.input, layer.input_weight, layer.input_bias, /*relu=*/false, step.gates);
      }
    }
    for (std::size_t t = 0; t < state.steps.size(); ++t) {
      Step& step = state.steps[t];
      if (t == 0) {
        SetRows(layer.state_bias, step.state_gates);
      } else {
        Linear(step.before, layer.state_weight, layer.state_bias, /*relu=*/false, step.state_gates);
      }
      GruStep(step.before, step.state_gates, step.gates, step.after);
    }
  }
}

void GruEncoder::ParameterGradient(EncoderPass& encoder_pass, Encoder& encoder_gradient) const {
  GruPass& pass = static_cast<GruPass&>(encoder_pass);
  GruEncoder& gradient = static_cast<GruEncoder&>(encoder_gradient);
  pass.layers.back().state_gradients.zero_();
  for (std::size_t i = layers_.size(); i-- > 0;) {
    const Layer& layer = layers_[i];
    Layer& result = gradient.layers_[i];
    LayerPass& state = pass.layers[i];
    at::Tensor none;
    for (std::size_t t = state.steps.size(); t-- > 0;) {
      Step& step = state.steps[t];
      at::Tensor& before_gradient = t > 0 ? state.steps[t - 1].after_gradient : none;
      GruStepGradient(step.before, step.after_gradient, step.state_gates, step.gates,
                      before_gradient);
      if (t > 0) {
        LinearInputGradient(step.state_gates, layer.state_weight, {}, before_gradient, Into::kAdd);
      }
    }
    // The first step's state is zero: it adds to the bias alone.
    if (state.later_states.defined()) {
      LinearWeightGradient(state.later_states, state.later_state_gates, result.state_weight,
                           result.state_bias);
    } else {
      result.state_weight.zero_();
      result.state_bias.zero_();
    }
    AddColumnSums(state.steps[0].state_gates, result.state_bias);
    if (state.inputs.defined()) {
      LinearWeightGradient(state.inputs, state.gates, result.input_weight, result.input_bias);
      LinearInputGradient(state.gates, layer.input_weight, {}, pass.layers[i - 1].state_gradients);
      continue;
    }
    for (std::size_t t = 0; t < state.steps.size(); ++t) {
      LinearWeightGradient(state.steps[t].input, state.steps[t].gates, result.input_weight,
                           result.input_bias, t == 0 ? Into::kReplace : Into::kAdd);
    }
  }
}

}  // namespace

template <>
std::unique_ptr<Encoder> MakeEncoderOf<EncoderKind::kGru>(const NetworkShape& shape,
                                                          const at::Tensor& parameters) {
  return std::make_unique<GruEncoder>(shape, parameters);
}

template <>
std::unique_ptr<EncoderPass> MakeEncoderPassOf<EncoderKind::kGru>(const NetworkShape& shape,
                                                                  const EncoderPorts& ports) {
  return GruEncoder::MakePass(shape, ports);
}

}  // namespace slalom::nn
