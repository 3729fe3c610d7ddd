#pragma once

#include <ATen/core/Tensor.h>
#include <ATen/ops/zeros_like.h>

#include "learner/algorithm.h"
#include "learner/critics.h"

namespace slalom::learner {

/// The common base of actor-critic algorithms: an actor of type `Actor`, some critics, and the
/// vectors passed between them. A derived class adds the update rule.
template <class Actor>
class ActorCritic : public Algorithm {
 public:
  /// `critic_outputs`: number of outputs of a critic, such as quantiles.
  ActorCritic(const AlgorithmContext& context, int num_critics, int critic_outputs = 1)
      : config_(context.config),
        minibatch_(context.minibatch),
        totals_(context.totals),
        constraint_(context.constraint),
        actor_(context.spec.actor_shape(), context.spec.distribution, context.initial_weights,
               context.minibatch),
        critics_("critics", context.spec.critic_shape(critic_outputs), num_critics,
                 context.initial_weights, context.minibatch),
        target_(at::zeros_like(context.minibatch.reward)),
        td_errors_(at::zeros_like(context.minibatch.reward)) {}

  int num_critics() const override { return critics_.size(); }
  const at::Tensor& td_errors() const override { return td_errors_; }
  const at::Tensor& actor_parameters() const override { return actor_.parameters(); }
  const at::Tensor& critic_parameters() const override { return critics_.parameters(); }
  const at::Tensor& average_parameters() const override {
    return config_.average_rate > 0.0 ? actor_.average_parameters() : actor_.parameters();
  }
  const at::Tensor& ActNext() override { return actor_.ActNext(); }

  void StartFrom(const at::Tensor& actor_parameters) override {
    actor_.StartFrom(actor_parameters);
  }

  void SaveState(nn::TensorMap& tensors) const override {
    actor_.SaveState(tensors);
    critics_.SaveState(tensors);
  }
  void LoadState(const nn::TensorFile& file) override {
    actor_.LoadState(file);
    critics_.LoadState(file);
  }

 protected:
  /// Takes one gradient step on mean (Q_k(s, a) - y)^2 with y = target_, and one of a constraint's
  /// critics on the same transitions with the next action a', then updates the target networks at
  /// `polyak_rate`.
  void UpdateCritics(const at::Tensor& next_action, double rate, double polyak_rate) {
    const Critics::Importance importance{minibatch_.weight, td_errors_};
    critics_.GradientStep(minibatch_.features, minibatch_.actions, target_,
                          rate * config_.critic_learning_rate, polyak_rate,
                          totals_[Total::kCriticLoss], totals_[Total::kQ],
                          totals_[Total::kCriticNorm], config_.prioritized ? &importance : nullptr);
    if (constraint_) {
      constraint_->UpdateCritics(next_action, rate * config_.critic_learning_rate, polyak_rate);
    }
  }

  double AverageRate() const { return PolicyAverageRate(config_, totals_); }

  const LearnerConfig config_;
  Minibatch& minibatch_;
  Totals& totals_;
  Constraint* const constraint_;
  Actor actor_;
  Critics critics_;
  at::Tensor target_;     // [B], y
  at::Tensor td_errors_;  // [B], |Q(s, a) - y|; set only with prioritized replay.
};

}  // namespace slalom::learner
