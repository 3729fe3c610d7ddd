#include "tests/learner/reference_network.h"

#include <torch/torch.h>

#include <cmath>
#include <tuple>
#include <vector>

#include "env/observation.h"

namespace slalom::learner {
namespace {

using at::Tensor;

/// The tensors of a network, one after the other.
class Parts {
 public:
  explicit Parts(std::vector<Tensor> parts) : parts_(std::move(parts)) {}

  Tensor Take() { return parts_.at(next_++); }
  std::vector<Tensor> Take(std::size_t count) {
    std::vector<Tensor> taken;
    for (std::size_t i = 0; i < count; ++i) taken.push_back(Take());
    return taken;
  }

  Tensor Linear(const Tensor& x) {
    const Tensor weight = Take();
    return torch::linear(x, weight, Take());
  }
  Tensor Norm(const Tensor& x) {
    const Tensor gain = Take();
    return torch::layer_norm(x, {x.size(-1)}, gain, Take());
  }
  /// `x`: [B, channels, positions]. Ours have a window's positions before its channels.
  Tensor Convolution(const Tensor& x, int stride, int padding) {
    const Tensor weight = Take().transpose(1, 2);
    return torch::relu(torch::conv1d(x, weight, Take(), stride, padding));
  }

 private:
  std::vector<Tensor> parts_;
  std::size_t next_ = 0;
};

Tensor TimeCnn(Parts& parts, const Tensor& frames) {
  const Tensor first = parts.Convolution(frames.transpose(1, 2), 1, 1);
  return parts.Convolution(first, 1, 0).flatten(1);
}

Tensor BeamCnn(Parts& parts, const nn::NetworkConfig& config, const Tensor& frames) {
  const std::int64_t ranges = frames.size(2) - static_cast<std::int64_t>(env::kStateSize);
  Tensor x = frames.narrow(2, 0, ranges);
  for (std::size_t i = 0; i + 1 < config.encoder_layers.size(); ++i) x = parts.Convolution(x, 2, 0);
  const Tensor state = frames.narrow(2, ranges, env::kStateSize).flatten(1);
  return torch::relu(parts.Linear(torch::cat({x.transpose(1, 2).flatten(1), state}, 1)));
}

Tensor Gru(Parts& parts, const nn::NetworkConfig& config, const Tensor& frames) {
  const std::int64_t layers = std::ssize(config.encoder_layers);
  // Ours of a layer: weight and bias of the input, then of the state. LibTorch's: both weights
  // first.
  std::vector<Tensor> weights;
  for (std::int64_t i = 0; i < layers; ++i) {
    const std::vector<Tensor> ours = parts.Take(4);
    weights.insert(weights.end(), {ours[0], ours[2], ours[1], ours[3]});
  }
  const Tensor start =
      torch::zeros({layers, frames.size(0), config.encoder_layers[0]}, frames.options());
  const Tensor outputs = std::get<0>(torch::gru(frames, start, weights, /*has_biases=*/true, layers,
                                                /*dropout=*/0.0, /*train=*/true,
                                                /*bidirectional=*/false, /*batch_first=*/true));
  return outputs.select(1, -1);
}

/// Causal: a frame sees itself and those before it.
Tensor Attention(Parts& parts, int heads, const Tensor& x) {
  const std::int64_t batch = x.size(0), steps = x.size(1), width = x.size(2);
  const std::vector<Tensor> projected =
      parts.Linear(x).view({batch, steps, 3, heads, width / heads}).unbind(2);
  const Tensor query = projected[0].transpose(1, 2), key = projected[1].transpose(1, 2),
               value = projected[2].transpose(1, 2);
  const Tensor later = torch::ones({steps, steps}, x.options().dtype(torch::kBool)).triu(1);
  const Tensor scores =
      (torch::matmul(query, key.transpose(2, 3)) / std::sqrt(static_cast<double>(width / heads)))
          .masked_fill(later, -INFINITY);
  const Tensor seen = torch::matmul(torch::softmax(scores, -1), value);
  return parts.Linear(seen.transpose(1, 2).reshape({batch, steps, width}));
}

Tensor Transformer(Parts& parts, const nn::NetworkConfig& config, const Tensor& frames) {
  const Tensor embedded = parts.Linear(frames);
  const Tensor time = parts.Take();
  Tensor x = parts.Norm(embedded + time);
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    x = x + Attention(parts, config.attention_heads, parts.Norm(x));
    const Tensor up = torch::gelu(parts.Linear(parts.Norm(x)), "tanh");
    x = x + parts.Linear(up);
  }
  return parts.Norm(x).select(1, -1);
}

}  // namespace

Tensor ReferenceForward(const nn::NetworkShape& shape, const Tensor& parameters,
                        const Tensor& features, const Tensor& action) {
  std::vector<Tensor> parts;
  for (const nn::ParameterSlot& slot : shape.Slots()) {
    parts.push_back(parameters.narrow(0, slot.offset, slot.size()).view(slot.shape));
  }
  return ReferenceForward(shape, std::move(parts), features, action);
}

Tensor ReferenceForward(const nn::NetworkShape& shape, std::vector<Tensor> parameters,
                        const Tensor& features, const Tensor& action) {
  const nn::NetworkConfig& config = shape.config;
  Parts parts(std::move(parameters));
  const Tensor frames = features.view({features.size(0), config.history, shape.frame_size});
  Tensor x = features;
  if (config.encoder == nn::EncoderFamily::kCnn) {
    x = config.cnn_axis == nn::CnnAxis::kBeams ? BeamCnn(parts, config, frames)
                                               : TimeCnn(parts, frames);
  } else if (config.encoder == nn::EncoderFamily::kGru) {
    x = Gru(parts, config, frames);
  } else if (config.encoder == nn::EncoderFamily::kTransformer) {
    x = Transformer(parts, config, frames);
  }
  for (int i = 0; i < shape.mlp.num_layers(); ++i) {
    if (shape.num_extra() > 0 && i == shape.mlp.extra_layer) x = torch::cat({x, action}, 1);
    x = parts.Linear(x);
    if (i + 1 == shape.mlp.num_layers()) break;
    if (shape.mlp.layer_norm) x = parts.Norm(x);
    x = torch::relu(x);
  }
  return x;
}

}  // namespace slalom::learner
