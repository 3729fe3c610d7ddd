#include "tests/learner/reference_model_loss.h"

#include <torch/torch.h>

#include <numbers>

namespace slalom::learner {

using at::Tensor;

ReferenceModelLoss ReferenceLossOf(const nn::TransitionModelConfig& config, double state_scale,
                                   const Tensor& raw, const ModelTargets& targets) {
  const bool probabilistic = config.kind == nn::ModelKind::kProbabilistic;
  const std::int64_t n = (raw.size(1) - 2) / (probabilistic ? 2 : 1);
  const std::int64_t frame = config.predict_last_action ? n : n + 2;
  // Ranges are all of a frame but the goal's x and y and the last action.
  const auto bound_ranges = [&](const Tensor& x) {
    return torch::cat({x.slice(1, 0, frame - 4).tanh(), x.slice(1, frame - 4, n)}, 1);
  };
  const std::int64_t newest = targets.features.size(1) - frame;
  const Tensor target = targets.next_features.narrow(1, newest, n);
  Tensor mean = raw.narrow(1, 0, n);
  if (config.bound_ranges) mean = bound_ranges(mean);
  if (config.targets == nn::ModelTargets::kDifference)
    mean = mean + targets.features.narrow(1, newest, n);
  Tensor state;
  Tensor z;
  if (probabilistic) {
    Tensor log_std = raw.narrow(1, n, n);
    log_std = config.log_std == nn::LogStdBounds::kBounded
                  ? config.log_std_min +
                        (config.log_std_max - config.log_std_min) * (1 + log_std.tanh()) / 2
                  : bound_ranges(log_std);
    const Tensor variance = (2 * log_std).exp();
    z = ((target - mean) / variance.sqrt()).detach();
    state =
        (0.5 * (variance * 2 * std::numbers::pi).log() + (target - mean).square() / (2 * variance))
            .sum(1);
  } else {
    state = (target - mean).square().sum(1);
  }
  const Tensor ended = (targets.discount == 0).to(torch::kDouble);
  return {state_scale * state + (raw.select(1, -2) - targets.reward).square() +
              torch::binary_cross_entropy_with_logits(raw.select(1, -1), ended, {}, {},
                                                      at::Reduction::None),
          z};
}

}  // namespace slalom::learner
