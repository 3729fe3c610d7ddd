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
/// What is inside is `Network`: its kernels for float32 on the CPU, LibTorch's operations on any
/// other device or type. A gradient reaches the parameters and the extra inputs (a critic's
/// action), and only what a backward pass asks for is computed. A graph keeps what its backward
/// pass needs, so the inputs may be overwritten in between.
///
/// Refused by a `base::Error` that says so: a gradient by the features, a double backward
/// (create_graph), and a second backward through one call (retain_graph). A backward pass after the
/// weights have moved is refused by LibTorch, whose words `Differentiate` passes on.
///
/// Thread-compatible. Movable. Memory is taken at the first calls, and used again once the graph
/// has been differentiated or dropped.
class AutogradNetworks {
 public:
  /// `parameters`: [K * P], one network after the other, shared, not copied. `dropout`: as
  /// `NetworkPass` takes it; applied in calls that are recorded, and with
  /// `NetworkConfig::dropout_everywhere` in those that are not, too.
  AutogradNetworks(const NetworkShape& shape, const at::Tensor& parameters,
                   base::Random* dropout = nullptr);

  /// Returns the outputs, [B, K, O]. Records nothing where autograd does not (`at::NoGradGuard`).
  /// `features`: [B, I]; `extra`: [B, E], or undefined where E is 0.
  at::Tensor operator()(const at::Tensor& features, const at::Tensor& extra = {}) const;

  /// Writes the gradient of `loss`, a tensor with one element, by all parameters to `gradient`,
  /// [K * P]. Adds to no `.grad()`. Throws `base::Error` where the loss has more elements, does not
  /// depend on these networks, was differentiated before, or is older than the weights.
  void Differentiate(const at::Tensor& loss, at::Tensor& gradient) const;

  /// The leaf of every graph, [K * P]. It shares the constructor's memory.
  const at::Tensor& parameters() const;

 private:
  class Networks;
  class Call;
  struct Apply;

  std::shared_ptr<Networks> networks_;
};

}  // namespace slalom::nn
