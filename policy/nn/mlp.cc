#include "policy/nn/mlp.h"

#include <ATen/ATen.h>

#include "base/check.h"
#include "policy/nn/kernels/layer_ops.h"

namespace slalom::nn {

MlpPass::MlpPass(const MlpShape& shape, const at::Tensor& input, PassUse use,
                 const at::Tensor& input_gradient, const PassResults& results)
    : input_gradient_(input_gradient) {
  SLALOM_CHECK_EQ(input.size(1), static_cast<std::int64_t>(shape.num_inputs + shape.num_extra));
  const std::int64_t batch = input.size(0);
  const int num_layers = shape.num_layers();
  const auto allocate = [&](std::int64_t columns) {
    return at::zeros({batch, columns}, input.options());
  };
  const auto place = [&](const at::Tensor& given, std::int64_t columns) {
    if (!given.defined()) return allocate(columns);
    SLALOM_CHECK(given.is_contiguous() && given.sizes() == at::IntArrayRef({batch, columns}));
    return given;
  };
  layers_.resize(num_layers);
  layers_[0].input = input.narrow(1, 0, shape.layer_inputs(0));
  for (int i = 0; i < num_layers; ++i) {
    const int outputs = shape.layer_outputs(i);
    const bool last = i + 1 == num_layers;
    if (use == PassUse::kTraining) {
      layers_[i].output_gradient = place(last ? results.output_gradient : at::Tensor(), outputs);
    }
    if (last) {
      layers_[i].output = place(results.output, outputs);
      continue;
    }
    layers_[i + 1].input = allocate(shape.layer_inputs(i + 1));
    layers_[i].output = layers_[i + 1].input.narrow(1, 0, outputs);
    if (shape.layer_norm) {
      layers_[i].normal = allocate(outputs);
      layers_[i].rstd = at::zeros({batch}, input.options());
    }
  }
  if (shape.num_extra > 0) {
    if (use == PassUse::kTraining) extra_gradient_ = place(results.extra_gradient, shape.num_extra);
    if (shape.extra_layer > 0) {
      extra_source_ = input.narrow(1, shape.num_inputs, shape.num_extra);
      extra_copy_ = layers_[shape.extra_layer].input.narrow(1, shape.hidden[shape.extra_layer - 1],
                                                            shape.num_extra);
    }
  }
  output_ = layers_.back().output;
  output_gradient_ = layers_.back().output_gradient;
}

Mlp::Mlp(const MlpShape& shape, const at::Tensor& parameters) : shape_(shape) {
  SLALOM_CHECK_EQ(parameters.numel(), shape.num_parameters());
  SLALOM_CHECK(parameters.is_contiguous());
  std::int64_t offset = 0;
  const auto take = [&](at::IntArrayRef sizes) {
    const std::int64_t size = c10::multiply_integers(sizes);
    offset += size;
    return parameters.narrow(0, offset - size, size).view(sizes);
  };
  for (int i = 0; i < shape.num_layers(); ++i) {
    const int inputs = shape.layer_inputs(i);
    const int outputs = shape.layer_outputs(i);
    const int extra = shape.num_extra > 0 && i == shape.extra_layer ? shape.num_extra : 0;
    Layer layer;
    layer.weight = take({outputs, inputs});
    layer.bias = take({outputs});
    if (shape.layer_norm && i + 1 < shape.num_layers()) {
      layer.gain = take({outputs});
      layer.norm_bias = take({outputs});
    }
    layer.weight_before = layer.weight.narrow(1, 0, inputs - extra);
    if (extra > 0) extra_weight_ = layer.weight.narrow(1, inputs - extra, extra);
    layers_.push_back(std::move(layer));
  }
}

void Mlp::Forward(MlpPass& pass) const {
  if (pass.extra_source_.defined()) pass.extra_copy_.copy_(pass.extra_source_);
  const int last = shape_.num_layers() - 1;
  for (int i = 0; i <= last; ++i) {
    const Layer& layer = layers_[i];
    MlpPass::Layer& state = pass.layers_[i];
    const bool normalise = layer.gain.defined();
    Linear(state.input, layer.weight, layer.bias, /*relu=*/i < last && !normalise, state.output);
    if (normalise)
      LayerNormRelu(layer.gain, layer.norm_bias, state.output, state.normal, state.rstd);
  }
}

void Mlp::ParameterGradient(MlpPass& pass, Mlp& gradient) const {
  const int last = shape_.num_layers() - 1;
  for (int i = last; i >= 0; --i) {
    MlpPass::Layer& state = pass.layers_[i];
    Layer& result = gradient.layers_[i];
    if (i < last) NormGradient(state, i, &result);
    LinearWeightGradient(state.input, state.output_gradient, result.weight, result.bias);
    if (i > 0) InputGradient(pass, i);
  }
  if (pass.input_gradient_.defined()) {
    LinearInputGradient(pass.layers_[0].output_gradient, layers_[0].weight_before, {},
                        pass.input_gradient_);
  }
}

void Mlp::ExtraGradient(MlpPass& pass) const {
  const int last = shape_.num_layers() - 1;
  for (int i = last; i >= shape_.extra_layer; --i) {
    MlpPass::Layer& state = pass.layers_[i];
    if (i < last) NormGradient(state, i, nullptr);
    if (i > shape_.extra_layer) InputGradient(pass, i);
  }
  LinearInputGradient(pass.layers_[shape_.extra_layer].output_gradient, extra_weight_, {},
                      pass.extra_gradient_);
}

void Mlp::InputGradient(MlpPass& pass, int layer) const {
  MlpPass::Layer& before = pass.layers_[layer - 1];
  const bool is_relu = !layers_[layer - 1].gain.defined();
  LinearInputGradient(pass.layers_[layer].output_gradient, layers_[layer].weight_before,
                      is_relu ? before.output : at::Tensor(), before.output_gradient);
}

void Mlp::NormGradient(MlpPass::Layer& pass, int layer, Layer* gradient) const {
  if (!layers_[layer].gain.defined()) return;
  at::Tensor unwanted;
  LayerNormReluGradient(layers_[layer].gain, pass.output, pass.normal, pass.rstd,
                        pass.output_gradient, gradient ? gradient->gain : unwanted,
                        gradient ? gradient->norm_bias : unwanted);
}

}  // namespace slalom::nn
