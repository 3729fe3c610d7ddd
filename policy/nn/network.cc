#include "policy/nn/network.h"

#include <ATen/ATen.h>

#include <span>
#include <vector>

#include "base/check.h"

namespace slalom::nn {

NetworkPass::NetworkPass(const NetworkShape& shape, const at::Tensor& input, PassUse use,
                         base::Random* dropout, const PassResults& results) {
  SLALOM_CHECK_EQ(input.size(1), static_cast<std::int64_t>(shape.num_inputs() + shape.num_extra()));
  if (!shape.has_encoder()) {
    mlp_.emplace(shape.mlp, input, use, at::Tensor(), results);
    return;
  }
  const std::int64_t width = shape.mlp.num_inputs;
  const at::Tensor head = at::zeros({input.size(0), width + shape.num_extra()}, input.options());
  at::Tensor gradient;
  if (use == PassUse::kTraining) gradient = at::zeros({input.size(0), width}, input.options());
  mlp_.emplace(shape.mlp, head, use, gradient, results);
  const bool drops = use == PassUse::kTraining || shape.config.dropout_everywhere;
  encoder_ = MakeEncoderPass(shape, {.input = input.narrow(1, 0, shape.num_inputs()),
                                     .features = head.narrow(1, 0, width),
                                     .feature_gradient = gradient,
                                     .use = use,
                                     .dropout = drops ? dropout : nullptr});
  if (shape.num_extra() > 0) {
    extra_source_ = input.narrow(1, shape.num_inputs(), shape.num_extra());
    extra_copy_ = head.narrow(1, width, shape.num_extra());
  }
}

Network::Network(const NetworkShape& shape, const at::Tensor& parameters)
    : mlp_(shape.mlp, parameters.narrow(0, parameters.numel() - shape.mlp.num_parameters(),
                                        shape.mlp.num_parameters())) {
  SLALOM_CHECK_EQ(parameters.numel(), shape.num_parameters());
  if (shape.has_encoder()) {
    encoder_ = MakeEncoder(
        shape, parameters.narrow(0, 0, parameters.numel() - shape.mlp.num_parameters()));
  }
}

void Network::Forward(NetworkPass& pass) const {
  if (encoder_) {
    encoder_->Forward(*pass.encoder_);
    if (pass.extra_source_.defined()) pass.extra_copy_.copy_(pass.extra_source_);
  }
  mlp_.Forward(*pass.mlp_);
}

void Network::ParameterGradient(NetworkPass& pass, Network& gradient) const {
  mlp_.ParameterGradient(*pass.mlp_, gradient.mlp_);
  if (encoder_) encoder_->ParameterGradient(*pass.encoder_, *gradient.encoder_);
}

at::Tensor InitialParameters(const NetworkShape& shape, int num_networks, base::Random& random,
                             at::Device device) {
  const std::int64_t size = shape.num_parameters();
  std::vector<float> host(static_cast<std::size_t>(num_networks * size));
  for (int i = 0; i < num_networks; ++i) {
    InitialiseParameters(shape, random, std::span(host).subspan(i * size, size));
  }
  return at::from_blob(host.data(), {num_networks * size}, at::kFloat).clone().to(device);
}

at::Tensor ViewWeights(const std::vector<float>& weights) {
  return at::from_blob(const_cast<float*>(weights.data()),
                       {static_cast<std::int64_t>(weights.size())}, at::kFloat);
}

}  // namespace slalom::nn
