#include <ATen/ATen.h>
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "policy/nn/encoder.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/kernels/attention.h"
#include "policy/nn/kernels/dropout.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/sequence_ops.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `H` frames, `W` width, `A` heads; `N` = B * H rows, frame after frame of each
/// sample; `M` rows that a block gives on, N or, in the last, B.

namespace slalom::nn {
namespace {

/// The body of GPT-2 (Radford et al. 2019) over the frames, as the original's: frames embedded
/// linearly, a learned vector for each place in the stack added, LayerNorm; causal blocks, each
/// LayerNorm and attention, then LayerNorm and a GELU layer of four times the width; LayerNorm. The
/// features are the newest frame's.
///
/// As nothing reads the last block's other rows, it asks for the newest frame alone.
class TransformerEncoder : public Encoder {
 public:
  TransformerEncoder(const NetworkShape& shape, const at::Tensor& parameters);
  static std::unique_ptr<EncoderPass> MakePass(const NetworkShape& shape,
                                               const EncoderPorts& ports);

  void Forward(EncoderPass& pass) const override;
  void ParameterGradient(EncoderPass& pass, Encoder& gradient) const override;

 private:
  struct Norm {
    at::Tensor gain, bias;  // [W]
  };
  struct Layer {
    at::Tensor weight, bias;  // [O, I], [O]
  };
  struct Block {
    Norm attention_norm;
    Layer query, key_value, query_key_value;  // Rows of one weight: [W], [2 W] and all [3 W].
    Layer output;
    Norm mlp_norm;
    Layer up, down;
  };
  struct BlockPass;
  struct Pass;

  void ForwardBlock(const Block& block, BlockPass& pass) const;
  void BlockGradient(const Block& block, BlockPass& pass, Block& gradient) const;

  Layer embedding_;
  at::Tensor time_;  // [H * W]
  Norm embedding_norm_;
  std::vector<Block> blocks_;
  Norm norm_;
};

/// Results of LayerNorm that its gradient needs.
struct NormPass {
  NormPass() = default;
  explicit NormPass(const at::Tensor& like)
      : normal(at::zeros_like(like)), rstd(at::zeros({like.size(0)}, like.options())) {}

  at::Tensor normal;  // [rows, W]
  at::Tensor rstd;    // [rows]
};

/// Memory for gradients that blocks use one after the other.
struct Scratch {
  at::Tensor masked;     // [N, W]
  at::Tensor normal;     // [N, W]
  at::Tensor attended;   // [N, W]
  at::Tensor activated;  // [N, 4 W]
  at::Tensor products;   // [N, 3 W]
};

struct TransformerEncoder::BlockPass {
  at::Tensor input;  // [N, W]
  NormPass attention_norm;
  at::Tensor normalised;         // [N, W]
  at::Tensor newest_normalised;  // [B, W], a view
  at::Tensor query;              // [M, W], in `products` or by itself
  at::Tensor products;           // [N, 3 W], or keys and values alone: [N, 2 W]
  AttentionInput attention;
  Dropout attention_dropout;
  at::Tensor weights;   // [B, A, H or 1, H]
  at::Tensor attended;  // [M, W]
  Dropout output_dropout;
  at::Tensor given_on;  // [M, W], a view of the input's rows that go on
  at::Tensor middle;    // [M, W], input + attention
  NormPass mlp_norm;
  at::Tensor mlp_input;  // [M, W]
  at::Tensor up;         // [M, 4 W]
  at::Tensor activated;  // [M, 4 W]
  Dropout mlp_dropout;
  at::Tensor output;  // [M, W], middle + MLP
  bool is_last = false;

  // Gradients, for training. Those by `output` and by `input` may be one tensor.
  at::Tensor output_gradient;             // [M, W]
  at::Tensor input_gradient;              // [N, W]
  at::Tensor newest_gradient;             // [B, W], a view of input_gradient
  Scratch scratch;                        // Views of as many rows as here.
  at::Tensor query_gradient;              // [M, W]
  at::Tensor key_gradient;                // [N, W], a view
  at::Tensor value_gradient;              // [N, W], a view
  at::Tensor product_gradient;            // As `products`.
  at::Tensor normalised_gradient;         // [N, W]
  at::Tensor newest_normalised_gradient;  // [B, W], a view
};

struct TransformerEncoder::Pass : EncoderPass {
  std::vector<at::Tensor> frames;           // [B, F] each
  std::vector<at::Tensor> embedded_frames;  // [B, W] each, views of `embedded`
  at::Tensor embedded_rows;                 // [B, H * W], a view of `embedded`
  at::Tensor embedded;                      // [N, W]
  NormPass embedding_norm;
  at::Tensor first;  // [N, W], input of the first block
  Dropout embedding_dropout;
  std::vector<BlockPass> blocks;
  NormPass norm;
  at::Tensor newest;  // [B, W], input of the last LayerNorm
  at::Tensor features, feature_gradient;

  at::Tensor first_gradient;                      // [N, W]
  at::Tensor first_gradient_rows;                 // [B, H * W], a view
  std::vector<at::Tensor> first_gradient_frames;  // [B, W] each, views
};

std::unique_ptr<EncoderPass> TransformerEncoder::MakePass(const NetworkShape& shape,
                                                          const EncoderPorts& ports) {
  const NetworkConfig& config = shape.config;
  const std::int64_t batch = ports.input.size(0);
  const std::int64_t history = config.history;
  const std::int64_t width = config.encoder_layers.front();
  const std::int64_t rows = batch * history;
  const bool training = ports.use == PassUse::kTraining;
  const auto allocate = [&](at::IntArrayRef sizes) {
    return at::zeros(sizes, ports.input.options());
  };
  const auto newest_of = [&](const at::Tensor& t) {  // [N, W] -> [B, W]
    return t.view({batch, history, width}).select(1, history - 1);
  };
  const auto frames_of = [&](const at::Tensor& t, std::int64_t size) {
    std::vector<at::Tensor> frames;
    for (std::int64_t i = 0; i < history; ++i) frames.push_back(t.narrow(1, i * size, size));
    return frames;
  };
  const auto dropout = [&](const at::Tensor& like) {
    return config.dropout > 0.0 && ports.dropout != nullptr
               ? Dropout(config.dropout, like, ports.dropout)
               : Dropout();
  };

  auto pass = std::make_unique<Pass>();
  pass->frames = frames_of(ports.input, shape.frame_size);
  pass->embedded = allocate({rows, width});
  pass->embedded_rows = pass->embedded.view({batch, history * width});
  pass->embedded_frames = frames_of(pass->embedded_rows, width);
  pass->embedding_norm = NormPass(pass->embedded);
  pass->first = allocate({rows, width});
  pass->embedding_dropout = dropout(pass->first);
  Scratch scratch;
  if (training) {
    pass->first_gradient = allocate({rows, width});
    pass->first_gradient_rows = pass->first_gradient.view({batch, history * width});
    pass->first_gradient_frames = frames_of(pass->first_gradient_rows, width);
    scratch = {allocate({rows, width}), allocate({rows, width}), allocate({rows, width}),
               allocate({rows, 4 * width}), allocate({rows, 3 * width})};
  }

  at::Tensor input = pass->first;
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    BlockPass block;
    block.is_last = i + 1 == config.encoder_layers.size();
    const std::int64_t given = block.is_last ? batch : rows;  // M
    block.input = input;
    block.attention_norm = NormPass(input);
    block.normalised = allocate({rows, width});
    block.newest_normalised = newest_of(block.normalised);
    block.products = allocate({rows, (block.is_last ? 2 : 3) * width});
    const std::int64_t key_column = block.is_last ? 0 : width;
    block.query = block.is_last ? allocate({batch, width}) : block.products.narrow(1, 0, width);
    block.attention = {.query = block.query,
                       .key = block.products.narrow(1, key_column, width),
                       .value = block.products.narrow(1, key_column + width, width),
                       .dropout_mask = {}};
    block.weights = allocate({batch, config.attention_heads, block.is_last ? 1 : history, history});
    block.attention_dropout = dropout(block.weights);
    block.attention.dropout_mask = block.attention_dropout.mask();
    block.attended = allocate({given, width});
    block.given_on = block.is_last ? newest_of(input) : input;
    block.middle = allocate({given, width});
    block.output_dropout = dropout(block.middle);
    block.mlp_norm = NormPass(block.middle);
    block.mlp_input = allocate({given, width});
    block.up = allocate({given, 4 * width});
    block.activated = allocate({given, 4 * width});
    block.output = allocate({given, width});
    block.mlp_dropout = dropout(block.output);
    if (training) {
      block.input_gradient = pass->first_gradient;
      block.newest_gradient = newest_of(block.input_gradient);
      block.output_gradient = block.is_last ? allocate({batch, width}) : pass->first_gradient;
      block.scratch = {scratch.masked.narrow(0, 0, given), scratch.normal.narrow(0, 0, given),
                       scratch.attended.narrow(0, 0, given), scratch.activated.narrow(0, 0, given),
                       scratch.products};
      block.product_gradient = block.is_last ? allocate({rows, 2 * width}) : scratch.products;
      block.query_gradient =
          block.is_last ? allocate({batch, width}) : block.product_gradient.narrow(1, 0, width);
      block.key_gradient = block.product_gradient.narrow(1, key_column, width);
      block.value_gradient = block.product_gradient.narrow(1, key_column + width, width);
      block.normalised_gradient = scratch.normal;
      block.newest_normalised_gradient = newest_of(block.normalised_gradient);
    }
    input = block.output;
    pass->blocks.push_back(std::move(block));
  }
  pass->newest = input;
  pass->norm = NormPass(input);
  pass->features = ports.features;
  pass->feature_gradient = ports.feature_gradient;
  return pass;
}

TransformerEncoder::TransformerEncoder(const NetworkShape& shape, const at::Tensor& parameters) {
  const ParameterViews views(EncoderSlots(shape.config, shape.frame_size), parameters);
  const auto layer = [&](const std::string& name) {
    return Layer{views[name + ".weight"], views[name + ".bias"]};
  };
  const auto norm = [&](const std::string& name) {
    return Norm{views[name + ".weight"], views[name + ".bias"]};
  };
  const auto rows_of = [](const Layer& all, std::int64_t begin, std::int64_t count) {
    return Layer{all.weight.narrow(0, begin, count), all.bias.narrow(0, begin, count)};
  };
  const std::int64_t width = shape.config.encoder_layers.front();
  embedding_ = layer("encoder.embedding");
  time_ = views["encoder.time"].view({-1});
  embedding_norm_ = norm("encoder.embedding.norm");
  for (std::size_t i = 0; i < shape.config.encoder_layers.size(); ++i) {
    const std::string name = fmt::format("encoder.{}.", i);
    const Layer all = layer(name + "attention.query_key_value");
    blocks_.push_back({.attention_norm = norm(name + "attention.norm"),
                       .query = rows_of(all, 0, width),
                       .key_value = rows_of(all, width, 2 * width),
                       .query_key_value = all,
                       .output = layer(name + "attention.output"),
                       .mlp_norm = norm(name + "mlp.norm"),
                       .up = layer(name + "mlp.0"),
                       .down = layer(name + "mlp.1")});
  }
  norm_ = norm("encoder.norm");
}

void TransformerEncoder::Forward(EncoderPass& encoder_pass) const {
  Pass& pass = static_cast<Pass&>(encoder_pass);
  for (std::size_t t = 0; t < pass.frames.size(); ++t) {
    Linear(pass.frames[t], embedding_.weight, embedding_.bias, /*relu=*/false,
           pass.embedded_frames[t]);
  }
  AddTo(time_, pass.embedded_rows);
  LayerNorm(embedding_norm_.gain, embedding_norm_.bias, pass.embedded, pass.first,
            pass.embedding_norm.normal, pass.embedding_norm.rstd);
  pass.embedding_dropout.Draw();
  pass.embedding_dropout.Apply(pass.first);
  for (std::size_t i = 0; i < blocks_.size(); ++i) ForwardBlock(blocks_[i], pass.blocks[i]);
  LayerNorm(norm_.gain, norm_.bias, pass.newest, pass.features, pass.norm.normal, pass.norm.rstd);
}

void TransformerEncoder::ForwardBlock(const Block& block, BlockPass& pass) const {
  LayerNorm(block.attention_norm.gain, block.attention_norm.bias, pass.input, pass.normalised,
            pass.attention_norm.normal, pass.attention_norm.rstd);
  if (pass.is_last) {
    Linear(pass.newest_normalised, block.query.weight, block.query.bias, /*relu=*/false,
           pass.query);
    Linear(pass.normalised, block.key_value.weight, block.key_value.bias, /*relu=*/false,
           pass.products);
  } else {
    Linear(pass.normalised, block.query_key_value.weight, block.query_key_value.bias,
           /*relu=*/false, pass.products);
  }
  pass.attention_dropout.Draw();
  Attend(pass.attention, pass.weights, pass.attended);
  Linear(pass.attended, block.output.weight, block.output.bias, /*relu=*/false, pass.middle);
  pass.output_dropout.Draw();
  pass.output_dropout.Apply(pass.middle);
  AddTo(pass.given_on, pass.middle);

  LayerNorm(block.mlp_norm.gain, block.mlp_norm.bias, pass.middle, pass.mlp_input,
            pass.mlp_norm.normal, pass.mlp_norm.rstd);
  Linear(pass.mlp_input, block.up.weight, block.up.bias, /*relu=*/false, pass.up);
  Gelu(pass.up, pass.activated);
  Linear(pass.activated, block.down.weight, block.down.bias, /*relu=*/false, pass.output);
  pass.mlp_dropout.Draw();
  pass.mlp_dropout.Apply(pass.output);
  AddTo(pass.middle, pass.output);
}

void TransformerEncoder::ParameterGradient(EncoderPass& encoder_pass,
                                           Encoder& encoder_gradient) const {
  Pass& pass = static_cast<Pass&>(encoder_pass);
  TransformerEncoder& gradient = static_cast<TransformerEncoder&>(encoder_gradient);
  LayerNormGradient(norm_.gain, pass.norm.normal, pass.norm.rstd, pass.feature_gradient,
                    pass.blocks.back().output_gradient, gradient.norm_.gain, gradient.norm_.bias);
  for (std::size_t i = blocks_.size(); i-- > 0;) {
    BlockGradient(blocks_[i], pass.blocks[i], gradient.blocks_[i]);
  }
  pass.embedding_dropout.Apply(pass.first_gradient);
  LayerNormGradient(embedding_norm_.gain, pass.embedding_norm.normal, pass.embedding_norm.rstd,
                    pass.first_gradient, pass.first_gradient, gradient.embedding_norm_.gain,
                    gradient.embedding_norm_.bias);
  gradient.time_.zero_();
  AddColumnSums(pass.first_gradient_rows, gradient.time_);
  for (std::size_t t = 0; t < pass.frames.size(); ++t) {
    LinearWeightGradient(pass.frames[t], pass.first_gradient_frames[t], gradient.embedding_.weight,
                         gradient.embedding_.bias, t == 0 ? Into::kReplace : Into::kAdd);
  }
}

void TransformerEncoder::BlockGradient(const Block& block, BlockPass& pass, Block& gradient) const {
  // Each branch is added to its input, so behind it the input's gradient is the sum's.
  const auto branch_gradient = [&pass](const Dropout& dropout) -> at::Tensor& {
    if (!dropout.mask().defined()) return pass.output_gradient;
    pass.scratch.masked.copy_(pass.output_gradient);
    dropout.Apply(pass.scratch.masked);
    return pass.scratch.masked;
  };
  const at::Tensor& mlp_gradient = branch_gradient(pass.mlp_dropout);
  LinearWeightGradient(pass.activated, mlp_gradient, gradient.down.weight, gradient.down.bias);
  LinearInputGradient(mlp_gradient, block.down.weight, {}, pass.scratch.activated);
  GeluGradient(pass.up, pass.scratch.activated);
  LinearWeightGradient(pass.mlp_input, pass.scratch.activated, gradient.up.weight,
                       gradient.up.bias);
  LinearInputGradient(pass.scratch.activated, block.up.weight, {}, pass.scratch.normal);
  LayerNormGradient(block.mlp_norm.gain, pass.mlp_norm.normal, pass.mlp_norm.rstd,
                    pass.scratch.normal, pass.output_gradient, gradient.mlp_norm.gain,
                    gradient.mlp_norm.bias, Into::kAdd);

  const at::Tensor& attention_gradient = branch_gradient(pass.output_dropout);
  LinearWeightGradient(pass.attended, attention_gradient, gradient.output.weight,
                       gradient.output.bias);
  LinearInputGradient(attention_gradient, block.output.weight, {}, pass.scratch.attended);
  AttendGradient(pass.attention, pass.weights, pass.scratch.attended, pass.query_gradient,
                 pass.key_gradient, pass.value_gradient);
  if (pass.is_last) {
    LinearWeightGradient(pass.newest_normalised, pass.query_gradient, gradient.query.weight,
                         gradient.query.bias);
    LinearWeightGradient(pass.normalised, pass.product_gradient, gradient.key_value.weight,
                         gradient.key_value.bias);
    LinearInputGradient(pass.product_gradient, block.key_value.weight, {},
                        pass.normalised_gradient);
    LinearInputGradient(pass.query_gradient, block.query.weight, {},
                        pass.newest_normalised_gradient, Into::kAdd);
  } else {
    LinearWeightGradient(pass.normalised, pass.product_gradient, gradient.query_key_value.weight,
                         gradient.query_key_value.bias);
    LinearInputGradient(pass.product_gradient, block.query_key_value.weight, {},
                        pass.normalised_gradient);
  }
  LayerNormGradient(block.attention_norm.gain, pass.attention_norm.normal, pass.attention_norm.rstd,
                    pass.normalised_gradient, pass.input_gradient, gradient.attention_norm.gain,
                    gradient.attention_norm.bias, pass.is_last ? Into::kReplace : Into::kAdd);
  if (pass.is_last) AddTo(pass.output_gradient, pass.newest_gradient);
}

}  // namespace

template <>
std::unique_ptr<Encoder> MakeEncoderOf<EncoderKind::kTransformer>(const NetworkShape& shape,
                                                                  const at::Tensor& parameters) {
  return std::make_unique<TransformerEncoder>(shape, parameters);
}

template <>
std::unique_ptr<EncoderPass> MakeEncoderPassOf<EncoderKind::kTransformer>(
    const NetworkShape& shape, const EncoderPorts& ports) {
  return TransformerEncoder::MakePass(shape, ports);
}

}  // namespace slalom::nn
