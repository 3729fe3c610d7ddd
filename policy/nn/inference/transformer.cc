#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/inference/inference_encoder.h"
#include "policy/nn/inference/layers.h"

/// A transformer over the frames, without LibTorch; policy/nn/transformer_encoder.cc trains it.
///
/// Shapes: `B` batch, `H` frames, `W` width, `A` heads; `N` = B * H rows, frame after frame of each
/// sample; `M` rows that a block gives on, N or, in the last, B.

namespace slalom::nn {

template <>
void CheckEncoder<EncoderKind::kTransformer>(const NetworkConfig& config) {
  const std::vector<int>& layers = config.encoder_layers;
  if (layers.empty() || std::ranges::count(layers, layers.front()) != std::ssize(layers)) {
    RefuseLayers(config, "one width or more, all equal, one for each block");
  }
  if (layers.front() % config.attention_heads != 0) {
    throw base::Error("network.attention_heads: found {}, expected a divisor of the width {}",
                      config.attention_heads, layers.front());
  }
}

template <>
std::vector<ParameterSlot> EncoderSlotsOf<EncoderKind::kTransformer>(const NetworkConfig& config,
                                                                     int frame_size) {
  constexpr double kGpt2Deviation = 0.02;  // Spread of a block's weights in the original's library.
  ParameterSlots slots;
  const std::int64_t width = config.encoder_layers.front();
  const auto add = [&slots](const std::string& name, std::int64_t outputs, std::int64_t inputs) {
    slots.Add(name + ".weight", {outputs, inputs}, InitialValues::Normal(kGpt2Deviation));
    slots.Add(name + ".bias", {outputs}, InitialValues::Constant(0.0));
  };
  slots.AddLinear("encoder.embedding", width, frame_size);
  slots.Add("encoder.time", {config.history, width}, InitialValues::Normal(1.0));
  slots.AddNorm("encoder.embedding.norm", width);
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    const std::string block = fmt::format("encoder.{}.", i);
    slots.AddNorm(block + "attention.norm", width);
    add(block + "attention.query_key_value", 3 * width, width);
    add(block + "attention.output", width, width);
    slots.AddNorm(block + "mlp.norm", width);
    add(block + "mlp.0", 4 * width, width);
    add(block + "mlp.1", width, 4 * width);
  }
  slots.AddNorm("encoder.norm", width);
  return slots.Take();
}

namespace {

class Transformer : public InferenceEncoder {
 public:
  Transformer(const NetworkShape& shape, const std::vector<ParameterSlot>& slots,
              const CpuFeatures& cpu)
      : history_(shape.config.history),
        frame_(shape.frame_size),
        width_(shape.config.encoder_layers.front()),
        heads_(shape.config.attention_heads),
        dropout_rate_(shape.config.dropout),
        embedding_(slots, "encoder.embedding", cpu),
        time_(slots, "encoder.time"),
        embedding_norm_(slots, "encoder.embedding.norm"),
        norm_(slots, "encoder.norm") {
    const std::size_t count = shape.config.encoder_layers.size();
    for (std::size_t i = 0; i < count; ++i) {
      const std::string name = fmt::format("encoder.{}.", i);
      const std::string products = name + "attention.query_key_value";
      // The last block asks for the newest frame only, with a product of its own.
      const bool is_last = i + 1 == count;
      blocks_.push_back({.attention_norm = NamedNorm(slots, name + "attention.norm"),
                         .newest_query = {},
                         .products = is_last
                                         ? NamedLinear(slots, products, {width_, 2 * width_}, cpu)
                                         : NamedLinear(slots, products, cpu),
                         .output = NamedLinear(slots, name + "attention.output", cpu),
                         .mlp_norm = NamedNorm(slots, name + "mlp.norm"),
                         .up = NamedLinear(slots, name + "mlp.0", cpu),
                         .down = NamedLinear(slots, name + "mlp.1", cpu)});
      if (is_last)
        blocks_.back().newest_query.emplace(slots, products, OutputRange{0, width_}, cpu);
    }
  }

  void SetWeights(const float* parameters) override {
    embedding_.SetWeights(parameters);
    time_.SetWeights(parameters);
    embedding_norm_.SetWeights(parameters);
    for (Block& block : blocks_) {
      block.attention_norm.SetWeights(parameters);
      if (block.newest_query) block.newest_query->SetWeights(parameters);
      block.products.SetWeights(parameters);
      block.output.SetWeights(parameters);
      block.mlp_norm.SetWeights(parameters);
      block.up.SetWeights(parameters);
      block.down.SetWeights(parameters);
    }
    norm_.SetWeights(parameters);
  }

  void Resize(std::int64_t batch) override {
    batch_ = batch;
    const std::int64_t rows = batch * history_;
    embedded_.Resize(rows, width_);
    stream_.Resize(rows, width_);
    normalised_.Resize(rows, width_);
    query_.Resize(batch, width_);
    products_.Resize(rows, 3 * width_);
    weights_.Resize(batch * heads_ * history_, history_);
    attended_.Resize(rows, width_);
    middle_.Resize(rows, width_);
    up_.Resize(rows, 4 * width_);
    activated_.Resize(rows, 4 * width_);
    unit_.Resize(1, width_);
    rstd_.Resize(rows, 1);
    mask_.Resize(std::max(rows * width_, weights_.size()), 1);
  }

  void Forward(Rows input, base::Random* dropout, Rows features) override {
    const std::int64_t rows = batch_ * history_;
    if (dropout_rate_ == 0.0) dropout = nullptr;
    const Rows samples = {embedded_.data(), history_ * width_};  // [B, H * W]
    for (std::int64_t t = 0; t < history_; ++t) {
      embedding_->Forward(batch_, input.From(0, t * frame_), /*relu=*/false,
                          samples.From(0, t * width_));
    }
    AddRows({batch_, history_ * width_}, {const_cast<float*>(time_.data()), 0}, samples);
    Normalise(rows, embedding_norm_, embedded_.rows(), stream_.rows());
    Drop(dropout, rows, stream_.data());
    for (const Block& block : blocks_) ForwardBlock(block, dropout);
    Normalise(batch_, norm_, stream_.rows(), features);
  }

 private:
  struct Block {
    NamedNorm attention_norm;
    std::optional<NamedLinear> newest_query;  // [W, W], in the last block, which asks for no others
    NamedLinear products;  // Queries, keys and values [3 W, W]; in the last keys and values
    NamedLinear output;
    NamedNorm mlp_norm;
    NamedLinear up, down;
  };

  /// The rows of the newest frames: [B, W] of [N, W].
  Rows Newest(Buffer& all) const { return {all.rows()[history_ - 1], history_ * all.columns()}; }

  void Normalise(std::int64_t rows, const NamedNorm& norm, Rows x, Rows y) {
    LayerNormRows({rows, width_}, norm.gain.data(), norm.bias.data(), x, y, {unit_.data(), 0},
                  rstd_.data());
  }

  /// y *= a mask drawn for it; y: [rows, W], dense.
  void Drop(base::Random* dropout, std::int64_t rows, float* y) {
    if (dropout == nullptr) return;
    const std::span mask(mask_.data(), static_cast<std::size_t>(rows * width_));
    DrawDropoutMask(dropout_rate_, *dropout, mask);
    ApplyDropoutMask(mask, y);
  }

  /// Reads `stream_` [N, W] and overwrites it by the block's output, [M, W].
  void ForwardBlock(const Block& block, base::Random* dropout) {
    const std::int64_t rows = batch_ * history_;
    const bool is_last = block.newest_query.has_value();
    const std::int64_t given = is_last ? batch_ : rows;  // M
    Normalise(rows, block.attention_norm, stream_.rows(), normalised_.rows());
    const Rows products = {products_.data(), block.products->outputs()};
    block.products->Forward(rows, normalised_.rows(), /*relu=*/false, products);
    if (is_last) {
      (*block.newest_query)->Forward(batch_, Newest(normalised_), /*relu=*/false, query_.rows());
    }
    const std::int64_t key_column = is_last ? 0 : width_;
    const AttentionSizes sizes = {.batch = batch_,
                                  .heads = heads_,
                                  .queries = is_last ? 1 : history_,
                                  .tokens = history_,
                                  .width = width_ / heads_};
    if (dropout != nullptr) {
      const std::int64_t numbers = batch_ * heads_ * sizes.queries * history_;
      DrawDropoutMask(dropout_rate_, *dropout, {mask_.data(), static_cast<std::size_t>(numbers)});
    }
    AttendRows(sizes, is_last ? query_.rows() : products, products.From(0, key_column),
               products.From(0, key_column + width_), dropout == nullptr ? nullptr : mask_.data(),
               weights_.data(), attended_.rows());
    block.output->Forward(given, attended_.rows(), /*relu=*/false, middle_.rows());
    Drop(dropout, given, middle_.data());
    AddRows({given, width_}, is_last ? Newest(stream_) : stream_.rows(), middle_.rows());

    Normalise(given, block.mlp_norm, middle_.rows(), normalised_.rows());
    block.up->Forward(given, normalised_.rows(), /*relu=*/false, up_.rows());
    GeluNumbers(up_.data(), given * 4 * width_, activated_.data());
    block.down->Forward(given, activated_.rows(), /*relu=*/false, stream_.rows());
    Drop(dropout, given, stream_.data());
    AddRows({given, width_}, middle_.rows(), stream_.rows());
  }

  std::int64_t history_;
  std::int64_t frame_;
  std::int64_t width_;
  std::int64_t heads_;
  double dropout_rate_;
  NamedLinear embedding_;
  NamedVector time_;  // [H * W]
  NamedNorm embedding_norm_;
  std::vector<Block> blocks_;
  NamedNorm norm_;
  std::int64_t batch_ = 0;
  Buffer embedded_;    // [N, W]
  Buffer stream_;      // [N, W], passed from block to block
  Buffer normalised_;  // [N, W]
  Buffer query_;       // [B, W]
  Buffer products_;    // [N, 3 W]
  Buffer weights_;     // [B, A, H, H]
  Buffer attended_;    // [N, W]
  Buffer middle_;      // [N, W], after attention is added
  Buffer up_;          // [N, 4 W]
  Buffer activated_;   // [N, 4 W]
  Buffer unit_;        // [W], a row before gain and bias
  Buffer rstd_;        // [N]
  Buffer mask_;        // [max(N * W, B * A * H * H)]
};

}  // namespace

template <>
std::unique_ptr<InferenceEncoder> MakeInferenceEncoderOf<EncoderKind::kTransformer>(
    const NetworkShape& shape, const CpuFeatures& cpu) {
  return std::make_unique<Transformer>(shape, EncoderSlots(shape.config, shape.frame_size), cpu);
}

}  // namespace slalom::nn
