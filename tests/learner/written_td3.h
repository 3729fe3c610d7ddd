#pragma once

#include <ATen/ATen.h>

#include <tuple>

#include "learner/actor_critic.h"
#include "learner/deterministic_actor.h"
#include "learner/noise.h"

namespace slalom::learner {

/// Of all critics, for one target [B]: sum_k mean (Q_k(s, a) - y)^2. q: [B, K, 1].
inline at::Tensor CriticLoss(const at::Tensor& q, const at::Tensor& y) {
  return (q.squeeze(2) - y.unsqueeze(1)).square().mean(0).sum();
}

/// Fujimoto et al. 2018, algorithm 1.
class WrittenTd3 : public ActorCritic<DeterministicActor> {
 public:
  explicit WrittenTd3(const AlgorithmContext& context)
      : ActorCritic(context, /*num_critics=*/2),
        random_(base::DeriveSeed(context.seed, "target noise")),
        noise_(context.config.batch_size, 2, context.minibatch.input.device()) {}

  void Update(double rate) override {
    const auto& [s, a, next_s] =
        std::tie(minibatch_.features, minibatch_.actions, minibatch_.next_features);
    const bool update_actor = totals_.num_updates() % config_.policy_delay == 0;
    const double tau = update_actor ? config_.tau : 0.0;
    const at::Tensor noise = noise_.Draw(random_, config_.target_noise, config_.noise_clip);
    const at::Tensor next_a = (actor_.TargetActions(next_s) + noise).clamp(-1.0, 1.0);
    const at::Tensor next_q = critics_.TargetValues(next_s, next_a).amin({1, 2});
    const at::Tensor y = minibatch_.reward + minibatch_.discount * next_q;
    critics_.Descend(CriticLoss(critics_.Values(s, a), y), rate * config_.critic_learning_rate, tau,
                     totals_[Total::kCriticNorm]);
    if (constraint_) constraint_->UpdateCritics(next_a, rate * config_.critic_learning_rate, tau);
    if (!update_actor) return;
    totals_.CountActorUpdate();
    const at::Tensor act = actor_.Actions(s);
    at::Tensor loss = -critics_.Values(s, act).select(1, 0).mean();
    if (constraint_) loss = loss + constraint_->Penalty(s, act);
    actor_.Descend(loss, rate * config_.actor_learning_rate, tau, AverageRate(),
                   totals_[Total::kActorNorm]);
  }

 private:
  base::Random random_;
  Noise noise_;
};

}  // namespace slalom::learner
