#pragma once

#include <ATen/core/Tensor.h>

#include <span>
#include <vector>

#include "base/parallel.h"
#include "learner/minibatch.h"
#include "policy/nn/network.h"

/// Shapes: `B` batch, `K` networks, `P` parameters, `I` inputs, `E` extra inputs and `O` outputs of
/// one, `S` slices of a minibatch.

namespace slalom::learner {

/// K networks of one shape, which the threads of a minibatch compute: each takes slices of the rows
/// (`Minibatch::Slices`) through whole networks. Every slice has a gradient of its own, and whoever
/// uses them adds them in the slices' order. So results depend on the slices, but not on the number
/// of threads. Without threads there is one slice, and the results are those of `nn::Network`.
/// Thread-compatible.
class SlicedNetworks {
 public:
  /// Inputs, outputs and intermediate results of a pass through the networks, for the whole
  /// minibatch. Allocates on construction only.
  class Pass {
   public:
    /// `input`: [B, I + E], kept, not copied.
    Pass(const nn::NetworkShape& shape, int num_networks, const at::Tensor& input, nn::PassUse use,
         const Minibatch& minibatch);

    /// As in `nn::NetworkPass`, of every network: [B, O], [B, O] and [B, E].
    std::span<at::Tensor> outputs() { return outputs_; }
    std::span<at::Tensor> output_gradients() { return output_gradients_; }
    std::span<at::Tensor> extra_gradients() { return extra_gradients_; }
    /// Of the first network.
    at::Tensor& output() { return outputs_.front(); }
    at::Tensor& output_gradient() { return output_gradients_.front(); }
    at::Tensor& extra_gradient() { return extra_gradients_.front(); }

   private:
    friend class SlicedNetworks;

    std::vector<at::Tensor> outputs_;           // [K]
    std::vector<at::Tensor> output_gradients_;  // [K]; none in inference
    std::vector<at::Tensor> extra_gradients_;   // [K]; none in inference, or if E is 0
    std::vector<nn::NetworkPass> passes_;       // [S * K], slice by slice
  };

  /// `parameters`: [K * P], one network after the other; `gradients`: [S, K * P], or undefined if
  /// `ParameterGradient` is not called. Both are shared, not copied. Keeps the minibatch's threads.
  SlicedNetworks(const nn::NetworkShape& shape, int num_networks, const at::Tensor& parameters,
                 const at::Tensor& gradients, const Minibatch& minibatch);

  /// Compute the results of `nn::Network`'s functions of the same name, of all networks or of the
  /// first `num_networks`. Gradients by parameters go to `gradients`, a row for each slice.
  void Forward(Pass& pass, int num_networks) const;
  void Forward(Pass& pass) const { Forward(pass, num_networks_); }
  void ParameterGradient(Pass& pass);
  void ExtraGradient(Pass& pass, int num_networks) const;

 private:
  /// Calls body(slice, k) for each slice and each of the first `num_networks` networks.
  template <class Body>
  void ForEach(int num_networks, const Body& body) const {
    base::For(parallel_, num_slices_ * num_networks,
              [&](int i) { body(i / num_networks, i % num_networks); });
  }

  const int num_networks_;
  const int num_slices_;
  base::ParallelFor* const parallel_;
  std::vector<nn::Network> networks_;   // [K]
  std::vector<nn::Network> gradients_;  // [S * K], slice by slice
};

/// Returns room for the gradients by `parameters`, [S, K * P].
at::Tensor MakeGradients(const at::Tensor& parameters, const Minibatch& minibatch);

}  // namespace slalom::learner
