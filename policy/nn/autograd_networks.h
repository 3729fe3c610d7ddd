#pragma once

#include <ATen/core/Tensor.h>

#include <memory>

#include "base/random.h"
#include "policy/nn/network_shape.h"

/// Shapes: `B` batch, `K` networks, `P` parameters of one, `I` = H * F inputs, `E` extra inputs,
/// `O` outputs of one.

namespace slalom::nn {

/// K networks of one shape as a function that LibTorch's autograd differentiates. A loss can then
/// be written in LibTorch's operations, on any encoder, and its gradient needs no derivation:
///
///     const at::Tensor q = critics(state, action);  // [B, K, O]
///     const at::Tensor loss = (q - y).square().mean();
///     critics.Differentiate(loss, gradient);        // [K * P], as `Adam` takes it
///
/// The computation is `Network`'s: its kernels for float32 on the CPU, LibTorch's operations on any
/// other device or type. A gradient reaches the parameters and the extra inputs (a critic's
/// action), and a backward pass computes only the gradients that it asks for. A graph keeps
/// everything that its backward pass needs, so the inputs may be overwritten in between.
///
/// Throws `base::Error` for a gradient by the features, a double backward (create_graph), and a
/// second backward through one call (retain_graph). LibTorch refuses a backward pass after the
/// weights have moved; `Differentiate` passes its message on.
///
/// Thread-compatible. Movable. The first calls allocate memory, which is used again once the graph
/// has been differentiated or dropped.
class AutogradNetworks {
 public:
  /// `parameters`: [K * P], one network after the other, shared, not copied. `dropout` is as for
  /// `NetworkPass`. It is applied in calls that are recorded and, with
  /// `NetworkConfig::dropout_everywhere`, also in those that are not.
  AutogradNetworks(const NetworkShape& shape, const at::Tensor& parameters,
                   base::Random* dropout = nullptr);

  /// Returns the outputs, [B, K, O]. Records nothing if autograd does not (`at::NoGradGuard`).
  /// `features`: [B, I]; `extra`: [B, E], or undefined if E is 0.
  at::Tensor operator()(const at::Tensor& features, const at::Tensor& extra = {}) const;

  /// Writes the gradient of `loss`, a tensor with one element, by all parameters to `gradient`,
  /// [K * P]. Adds to no `.grad()`. Throws `base::Error` if the loss has more elements, does not
  /// depend on these networks, was differentiated before, or is older than the weights.
  void Differentiate(const at::Tensor& loss, at::Tensor& gradient) const;

  /// The leaf of every graph, [K * P]. It shares its memory with the constructor's `parameters`.
  const at::Tensor& parameters() const;

 private:
  class Networks;
  class Call;
  struct Apply;

  std::shared_ptr<Networks> networks_;
};

}  // namespace slalom::nn
