#include "policy/nn/inference/inference_network.h"

#include <algorithm>

#include "base/check.h"

namespace slalom::nn {

std::unique_ptr<InferenceEncoder> MakeInferenceEncoder(const NetworkShape& shape,
                                                       const CpuFeatures& cpu) {
  return DispatchEncoder(shape.encoder, [&]<EncoderKind kKind>() {
    return MakeInferenceEncoderOf<kKind>(shape, cpu);
  });
}

InferenceNetwork::InferenceNetwork(const NetworkShape& shape, const CpuFeatures& cpu)
    : shape_(shape), num_parameters_(shape.num_parameters()) {
  if (shape.has_encoder()) encoder_ = MakeInferenceEncoder(shape, cpu);
  const std::vector<ParameterSlot> slots = shape.Slots();
  for (int i = 0; i < shape.mlp.num_layers(); ++i) {
    const std::string name = shape.mlp.layer_name(i);
    Layer layer{NamedLinear(slots, name, cpu), {}};
    SLALOM_CHECK(layer.linear->inputs() == shape.mlp.layer_inputs(i));
    if (shape.mlp.layer_norm && i + 1 < shape.mlp.num_layers()) {
      layer.norm.emplace_back(slots, name + ".norm");
    }
    layers_.push_back(std::move(layer));
  }
  layer_input_.resize(layers_.size());
}

void InferenceNetwork::SetWeights(std::span<const float> parameters) {
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(parameters.size()), num_parameters_);
  if (encoder_) encoder_->SetWeights(parameters.data());
  for (Layer& layer : layers_) {
    layer.linear.SetWeights(parameters.data());
    for (NamedNorm& norm : layer.norm) norm.SetWeights(parameters.data());
  }
}

void InferenceNetwork::Resize(int batch) {
  SLALOM_CHECK_GE(batch, 1);
  batch_ = batch;
  input_.Resize(batch, shape_.num_inputs() + shape_.num_extra());
  if (encoder_) encoder_->Resize(batch);
  std::int64_t widest = 1;
  for (int i = 0; i < shape_.mlp.num_layers(); ++i) {
    if (i > 0 || encoder_) layer_input_[i].Resize(batch, shape_.mlp.layer_inputs(i));
    widest = std::max<std::int64_t>(widest, shape_.mlp.layer_outputs(i));
  }
  if (shape_.mlp.layer_norm) {
    normal_.Resize(batch, widest);
    rstd_.Resize(batch, 1);
  }
  output_.Resize(batch, shape_.num_outputs());
}

Rows InferenceNetwork::LayerInput(int layer) {
  return layer == 0 && !encoder_ ? input_.rows() : layer_input_[layer].rows();
}

void InferenceNetwork::CopyExtra() {
  const int layer = shape_.mlp.extra_layer;
  if (shape_.num_extra() == 0 || (layer == 0 && !encoder_)) return;
  const Rows from = input_.rows().From(0, shape_.num_inputs());
  const Rows to = LayerInput(layer).From(0, shape_.mlp.layer_inputs(layer) - shape_.num_extra());
  for (std::int64_t i = 0; i < batch_; ++i) std::copy_n(from[i], shape_.num_extra(), to[i]);
}

void InferenceNetwork::Forward(base::Random* dropout) {
  SLALOM_CHECK(batch_ > 0);
  if (encoder_) {
    encoder_->Forward(input_.rows(), shape_.config.dropout_everywhere ? dropout : nullptr,
                      layer_input_[0].rows());
  }
  CopyExtra();
  const int last = shape_.mlp.num_layers() - 1;
  for (int i = 0; i <= last; ++i) {
    const Layer& layer = layers_[i];
    const Rows to = i == last ? output_.rows() : layer_input_[i + 1].rows();
    const bool normalise = !layer.norm.empty();
    layer.linear->Forward(batch_, LayerInput(i), /*relu=*/i < last && !normalise, to);
    if (normalise) {
      LayerNormReluRows({batch_, layer.linear->outputs()}, layer.norm[0].gain.data(),
                        layer.norm[0].bias.data(), to, normal_.rows(), rstd_.data());
    }
  }
}

}  // namespace slalom::nn
