#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "policy/nn/network_shape.h"

namespace slalom::learner {

/// What a network computes, as docs/networks.md has it, by LibTorch's own operations, through which
/// autograd goes. Shares no code with `nn::Network`. No dropout.
///
/// `parameters`: [shape.num_parameters()]; `features`: [B, H * F]; `action`: [B, 2], or undefined
/// where the network reads none. Returns [B, outputs].
at::Tensor ReferenceForward(const nn::NetworkShape& shape, const at::Tensor& parameters,
                            const at::Tensor& features, const at::Tensor& action);

/// The same on a tensor for each of shape.Slots(), as LibTorch's modules have them.
at::Tensor ReferenceForward(const nn::NetworkShape& shape, std::vector<at::Tensor> parameters,
                            const at::Tensor& features, const at::Tensor& action);

}  // namespace slalom::learner
