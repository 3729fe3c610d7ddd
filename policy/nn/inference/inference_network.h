#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/random.h"
#include "policy/nn/inference/inference_encoder.h"
#include "policy/nn/inference/layers.h"
#include "policy/nn/kernels/cpu_features.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `I` = H * F inputs, `E` extra inputs, `O` outputs of a network.

namespace slalom::nn {

/// A network that only acts: the forward pass of `nn::Network` on float32 in host memory, with
/// kernels of its own and without LibTorch or a BLAS. It drives robots, actors and evaluators.
///
/// The result has the same bits on every processor and, without dropout, in every batch. They are
/// the bits of `nn::Network` on a processor with AVX2 and FMA, unless a layer has more than
/// `kMaxSmallDepth` inputs, which training leaves to the BLAS. Confined to one thread at a time.
/// Movable.
class InferenceNetwork {
 public:
  /// All weights are 0 until they are set. `cpu` may deny features that the processor has.
  explicit InferenceNetwork(const NetworkShape& shape,
                            const CpuFeatures& cpu = DetectCpuFeatures());

  /// `parameters`: [shape.num_parameters()], copied. Allocates nothing.
  void SetWeights(std::span<const float> parameters);

  /// Makes room for `batch` rows, all of them 0. Allocates. Requires: batch >= 1.
  void Resize(int batch);
  int batch() const { return static_cast<int>(batch_); }

  /// [B, I + E], the stack of frames with the extra inputs behind it, for the caller to write.
  std::span<float> input() { return {input_.data(), static_cast<std::size_t>(input_.size())}; }

  /// Computes the outputs from the input. `dropout` draws the masks of a network that has dropout
  /// when acting (`NetworkConfig::dropout_everywhere`); if it is null, nothing is dropped.
  /// Allocates nothing. Requires: `Resize` was called.
  void Forward(base::Random* dropout = nullptr);

  /// [B, O], the output of the last `Forward`, before any tanh.
  std::span<const float> output() const {
    return {output_.data(), static_cast<std::size_t>(output_.size())};
  }

 private:
  struct Layer {
    NamedLinear linear;
    std::vector<NamedNorm> norm;  ///< One, or none without LayerNorm.
  };

  /// Input of layer i: the network's input, or the output of the layer before it.
  Rows LayerInput(int layer);
  /// Copies the extra inputs to the place where the head reads them.
  void CopyExtra();

  NetworkShape shape_;
  std::int64_t num_parameters_;
  std::unique_ptr<InferenceEncoder> encoder_;  // Null with encoder "mlp".
  std::vector<Layer> layers_;
  std::int64_t batch_ = 0;
  Buffer input_;                     // [B, I + E]
  std::vector<Buffer> layer_input_;  // [B, inputs of the layer]; empty if it reads `input_`
  Buffer normal_, rstd_;             // [B, widest], [B, 1], of LayerNorm
  Buffer output_;                    // [B, O]
};

}  // namespace slalom::nn
