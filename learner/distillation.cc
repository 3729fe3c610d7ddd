#include "learner/distillation.h"

#include <ATen/ATen.h>

namespace slalom::learner {

Distillation::Distillation(const AlgorithmContext& context)
    : config_(context.config),
      minibatch_(context.minibatch),
      totals_(context.totals),
      actor_(context.spec.actor_shape(), context.spec.distribution, context.initial_weights,
             context.minibatch),
      none_(at::zeros({0}, context.minibatch.input.options())),
      distance_(at::zeros_like(context.minibatch.actions)) {}

void Distillation::Update(double rate) {
  totals_.CountActorUpdate();
  // phi <- argmin mean |pi(s) - a*|^2, where a* is the teacher's action
  at::sub_out(distance_, actor_.Act(minibatch_.features), minibatch_.actions);
  const auto batch = static_cast<double>(distance_.size(0));
  totals_[Total::kActorQ].sub_(distance_.square().sum(), 1.0 / batch);
  distance_.mul_(2.0 / batch);
  // Nothing reads the target actor.
  actor_.PolicyGradientStep(distance_, config_.preactivation_penalty,
                            rate * config_.actor_learning_rate, /*polyak_rate=*/0.0,
                            PolicyAverageRate(config_, totals_), totals_[Total::kActorNorm]);
}

std::unique_ptr<Algorithm> MakeDistillation(const AlgorithmContext& context) {
  return std::make_unique<Distillation>(context);
}

}  // namespace slalom::learner
