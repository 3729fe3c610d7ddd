#include <ATen/ATen.h>

#include <algorithm>
#include <memory>

#include "policy/nn/encoder.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `H` frames of `F` numbers, `V` and `W` channels after the two convolutions.

namespace slalom::nn {
namespace {

/// Convolutions along time, as the original's: the numbers of a frame are channels. The first sees
/// three frames, with zeros before the oldest and behind the newest, the second all H; ReLU after
/// each.
///
/// A window of frames lies in one piece in the stack, so each is a product by itself, without a
/// copy; frames beyond the stack are left out instead of multiplied by zero.
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

struct TimeCnnPass : EncoderPass {
  std::vector<at::Tensor> windows;          // [B, (2 or 3) * F] each, views of the input
  std::vector<at::Tensor> places;           // [B, V] each, views of `hidden`
  std::vector<at::Tensor> place_gradients;  // [B, V] each, views of `hidden_gradient`
  at::Tensor hidden;                        // [B, H * V]
  at::Tensor hidden_gradient;               // [B, H * V]
  at::Tensor features, feature_gradient;    // [B, W]
};

/// The frames that the window around `place` covers.
struct Window {
  Window(int place, int history)
      : first(std::max(0, place - 1)),
        count(std::min(history, place + 2) - first),
        first_tap(first - (place - 1)) {}

  int first, count, first_tap;
};

std::unique_ptr<EncoderPass> TimeCnnEncoder::MakePass(const NetworkShape& shape,
                                                      const EncoderPorts& ports) {
  const int history = shape.config.history;
  const int channels = shape.config.encoder_layers[0];
  const std::int64_t frame = shape.frame_size;
  const std::int64_t batch = ports.input.size(0);
  auto pass = std::make_unique<TimeCnnPass>();
  pass->hidden = at::zeros({batch, history * channels}, ports.input.options());
  if (ports.use == PassUse::kTraining) pass->hidden_gradient = at::zeros_like(pass->hidden);
  for (int t = 0; t < history; ++t) {
    const Window window(t, history);
    pass->windows.push_back(ports.input.narrow(1, window.first * frame, window.count * frame));
    pass->places.push_back(pass->hidden.narrow(1, t * channels, channels));
    if (ports.use == PassUse::kTraining) {
      pass->place_gradients.push_back(pass->hidden_gradient.narrow(1, t * channels, channels));
    }
  }
  pass->features = ports.features;
  pass->feature_gradient = ports.feature_gradient;
  return pass;
}

TimeCnnEncoder::TimeCnnEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  const ParameterViews views(EncoderSlots(shape.config, shape.frame_size), parameters);
  const std::int64_t frame = shape.frame_size;
  first_weight_ = views["encoder.0.weight"].flatten(1);
  first_bias_ = views["encoder.0.bias"];
  second_weight_ = views["encoder.1.weight"].flatten(1);
  second_bias_ = views["encoder.1.bias"];
  for (int t = 0; t < shape.config.history; ++t) {
    const Window window(t, shape.config.history);
    window_weights_.push_back(
        first_weight_.narrow(1, window.first_tap * frame, window.count * frame));
  }
}

void TimeCnnEncoder::Forward(EncoderPass& encoder_pass) const {
  TimeCnnPass& pass = static_cast<TimeCnnPass&>(encoder_pass);
  for (std::size_t t = 0; t < window_weights_.size(); ++t) {
    Linear(pass.windows[t], window_weights_[t], first_bias_, /*relu=*/true, pass.places[t]);
  }
  Linear(pass.hidden, second_weight_, second_bias_, /*relu=*/true, pass.features);
}

void TimeCnnEncoder::ParameterGradient(EncoderPass& encoder_pass, Encoder& encoder_gradient) const {
  TimeCnnPass& pass = static_cast<TimeCnnPass&>(encoder_pass);
  TimeCnnEncoder& gradient = static_cast<TimeCnnEncoder&>(encoder_gradient);
  ReluGradient(pass.features, pass.feature_gradient);
  LinearWeightGradient(pass.hidden, pass.feature_gradient, gradient.second_weight_,
                       gradient.second_bias_);
  LinearInputGradient(pass.feature_gradient, second_weight_, pass.hidden, pass.hidden_gradient);
  gradient.first_weight_.zero_();
  gradient.first_bias_.zero_();
  for (std::size_t t = 0; t < window_weights_.size(); ++t) {
    LinearWeightGradient(pass.windows[t], pass.place_gradients[t], gradient.window_weights_[t],
                         gradient.first_bias_, Into::kAdd);
  }
}

}  // namespace

template <>
std::unique_ptr<Encoder> MakeEncoderOf<EncoderKind::kTimeCnn>(const NetworkShape& shape,
                                                              const at::Tensor& parameters) {
  return std::make_unique<TimeCnnEncoder>(shape, parameters);
}

template <>
std::unique_ptr<EncoderPass> MakeEncoderPassOf<EncoderKind::kTimeCnn>(const NetworkShape& shape,
                                                                      const EncoderPorts& ports) {
  return TimeCnnEncoder::MakePass(shape, ports);
}

}  // namespace slalom::nn
