#pragma once

#include <ATen/core/Tensor.h>

#include "learner/model_loss.h"
#include "policy/nn/model_shape.h"

namespace slalom::learner {

struct ReferenceModelLoss {
  at::Tensor loss;  ///< [B], of each transition; its weight is not in it.
  at::Tensor z;     ///< [B, M], (target - mean) / sigma, detached; undefined where deterministic.
};

/// What a transition model of `config` is trained by, as in docs/original-system.md, section 5.1,
/// from what its network gave, by LibTorch's own operations in float64, through which autograd
/// goes. Shares no code with `ModelLoss`. Success counts as `targets` say: that is left to the
/// caller.
///
/// `raw`: [B, outputs].
ReferenceModelLoss ReferenceLossOf(const nn::TransitionModelConfig& config, double state_scale,
                                   const at::Tensor& raw, const ModelTargets& targets);

}  // namespace slalom::learner
