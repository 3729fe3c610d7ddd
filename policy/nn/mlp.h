#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `I` inputs, `E` extra inputs, `O` outputs of a network.

namespace slalom::nn {

/// Purpose of a pass, which decides what it keeps.
enum class PassUse {
  kTraining,   ///< Forward and backward.
  kInference,  ///< Forward only: no memory for gradients.
};

/// Memory for the results of a pass, such as the rows of a larger batch's. A pass allocates what is
/// undefined.
struct PassResults {
  at::Tensor output;           ///< [B, O], dense
  at::Tensor output_gradient;  ///< [B, O], dense
  at::Tensor extra_gradient;   ///< [B, E], dense
};

/// Inputs, outputs and intermediate results of a pass through an `Mlp`, for one batch size.
/// Allocates on construction only.
///
/// Bound to its input: fill that tensor's memory, then call `Mlp::Forward`. Confined to one thread
/// at a time.
class MlpPass {
 public:
  /// `input`: [B, I + E], features with the extra inputs behind them; kept, not copied.
  /// `input_gradient`: [B, I], written by `Mlp::ParameterGradient`; undefined if not wanted. With
  /// `PassUse::kInference` there are no gradients.
  explicit MlpPass(const MlpShape& shape, const at::Tensor& input, PassUse use = PassUse::kTraining,
                   const at::Tensor& input_gradient = {}, const PassResults& results = {});

  at::Tensor& output() { return output_; }                    ///< [B, O], written by Forward.
  at::Tensor& output_gradient() { return output_gradient_; }  ///< [B, O], for the backward passes.
  at::Tensor& extra_gradient() { return extra_gradient_; }    ///< [B, E], written by ExtraGradient.

 private:
  friend class Mlp;

  struct Layer {
    at::Tensor input;            // [B, inputs of the layer]
    at::Tensor output;           // [B, outputs of the layer], inside the next layer's input
    at::Tensor output_gradient;  // [B, outputs of the layer]
    at::Tensor normal;           // [B, outputs], with LayerNorm
    at::Tensor rstd;             // [B], with LayerNorm
  };

  std::vector<Layer> layers_;
  at::Tensor extra_source_;  // [B, E] in the input; undefined if the input layer reads it in place
  at::Tensor extra_copy_;    // [B, E] in the input of layer `extra_layer`
  at::Tensor output_;
  at::Tensor output_gradient_;
  at::Tensor extra_gradient_;
  at::Tensor input_gradient_;  // [B, I], undefined if not wanted
};

/// A fully connected network whose parameters are views into one flat tensor, so that an optimiser,
/// Polyak averaging and saving are single passes over it.
///
/// Forward and backward are explicit: nothing is recorded, and a pass computes only the results
/// that are asked for. Thread-compatible; `Forward` of one network into different passes is
/// thread-safe.
class Mlp {
 public:
  /// `parameters`: [shape.num_parameters()], shared, not copied.
  Mlp(const MlpShape& shape, const at::Tensor& parameters);

  /// Computes pass.output() from the pass's input.
  void Forward(MlpPass& pass) const;

  /// Writes the gradients of all parameters into the parameters of `gradient`, a network of the
  /// same shape. Uses up the pass. Requires: `Forward` has run and pass.output_gradient() is set.
  void ParameterGradient(MlpPass& pass, Mlp& gradient) const;

  /// Writes pass.extra_gradient(), the gradient by the extra inputs, with the parameters frozen.
  /// Requires the same.
  void ExtraGradient(MlpPass& pass) const;

 private:
  struct Layer {
    at::Tensor weight;         // [outputs, inputs]
    at::Tensor bias;           // [outputs]
    at::Tensor gain;           // [outputs], with LayerNorm
    at::Tensor norm_bias;      // [outputs], with LayerNorm
    at::Tensor weight_before;  // [outputs, inputs from the layer before]
  };

  /// Passes the gradient by the output of `layer` > 0 back to the output of the layer before it,
  /// and through that layer's ReLU if it has no LayerNorm.
  void InputGradient(MlpPass& pass, int layer) const;
  /// Passes the output gradient of a hidden layer back through its LayerNorm and ReLU, if it has
  /// LayerNorm; `gradient` may be null.
  void NormGradient(MlpPass::Layer& pass, int layer, Layer* gradient) const;

  MlpShape shape_;
  std::vector<Layer> layers_;
  at::Tensor extra_weight_;  // [outputs of layer extra_layer, E]
};

}  // namespace slalom::nn
