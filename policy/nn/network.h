#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <optional>
#include <vector>

#include "base/random.h"
#include "policy/nn/encoder.h"
#include "policy/nn/mlp.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `I` = H * F inputs, `E` extra inputs, `O` outputs of a network.

namespace slalom::nn {

/// Inputs, outputs and intermediate results of a pass through a `Network`, for one batch size.
/// Allocates on construction only.
///
/// Bound to its input: fill that tensor's memory, then call `Network::Forward`. Confined to one
/// thread at a time. Movable.
class NetworkPass {
 public:
  /// `input`: [B, I + E], the stack of frames with the extra inputs behind it; kept, not copied.
  /// `dropout` draws the masks of a network that has dropout, and must outlive the pass. No dropout
  /// is applied if it is null, or in inference unless the config has it everywhere.
  explicit NetworkPass(const NetworkShape& shape, const at::Tensor& input,
                       PassUse use = PassUse::kTraining, base::Random* dropout = nullptr,
                       const PassResults& results = {});

  /// [B, O], written by Forward.
  at::Tensor& output() { return mlp_->output(); }
  /// [B, O], for the backward passes.
  at::Tensor& output_gradient() { return mlp_->output_gradient(); }
  /// [B, E], written by ExtraGradient.
  at::Tensor& extra_gradient() { return mlp_->extra_gradient(); }

 private:
  friend class Network;

  std::unique_ptr<EncoderPass> encoder_;  // Null with encoder "mlp".
  at::Tensor extra_source_;               // [B, E] in the input; undefined if not copied
  at::Tensor extra_copy_;                 // [B, E] in the head's input
  std::optional<MlpPass> mlp_;
};

/// An actor, a critic or a model: encoder and head on one flat parameter tensor, so that an
/// optimiser, Polyak averaging and saving are single passes over it.
///
/// Forward and backward are explicit: nothing is recorded, and a pass computes only the results
/// that are asked for. Thread-compatible; `Forward` of one network into different passes is
/// thread-safe. Movable.
class Network {
 public:
  /// `parameters`: [shape.num_parameters()], shared, not copied.
  Network(const NetworkShape& shape, const at::Tensor& parameters);

  /// Computes pass.output() from the pass's input.
  void Forward(NetworkPass& pass) const;

  /// Writes the gradients of all parameters into the parameters of `gradient`, a network of the
  /// same shape. Uses up the pass. Requires: `Forward` has run and pass.output_gradient() is set.
  void ParameterGradient(NetworkPass& pass, Network& gradient) const;

  /// Writes pass.extra_gradient(), the gradient by the extra inputs, with the parameters frozen.
  /// Requires the same.
  void ExtraGradient(NetworkPass& pass) const { mlp_.ExtraGradient(*pass.mlp_); }

 private:
  std::unique_ptr<Encoder> encoder_;  // Null with encoder "mlp".
  Mlp mlp_;                           // The whole network, or its head.
};

/// Returns newly initialised parameters of `num_networks` networks of one shape, one network after
/// the other: [num_networks * P].
at::Tensor InitialParameters(const NetworkShape& shape, int num_networks, base::Random& random,
                             at::Device device);

/// Views shared weights as a tensor [P], for networks that only run forward. Nothing may write to
/// it, and the weights must outlive it.
at::Tensor ViewWeights(const std::vector<float>& weights);

}  // namespace slalom::nn
