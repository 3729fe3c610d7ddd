#include "learner/td3.h"

#include "learner/stored_state.h"
#include "learner/value_ops.h"

namespace slalom::learner {

Td3::Td3(const AlgorithmContext& context)
    : ActorCritic(context, /*num_critics=*/2),
      random_(base::DeriveSeed(context.seed, "target noise")),
      noise_(context.config.batch_size, 2, context.minibatch.input.device()) {}

void Td3::Update(double rate) {
  totals_.CountUpdate();
  const bool update_actor = totals_.num_updates() % config_.policy_delay == 0;
  // The lines of Fujimoto et al. 2018, algorithm 1: "if t mod d", under which targets move, too.
  const double polyak_rate = update_actor ? config_.tau : 0.0;

  // Target policy smoothing, equation 14: a' = clip(pi'(s') + clip(N(0, sigma), -c, c), -1, 1)
  AddClippedNoise(actor_.ActTarget(),
                  noise_.Draw(random_, config_.target_noise, config_.noise_clip),
                  minibatch_.next_actions);
  // Clipped double Q-learning, equation 10: y = r + gamma^n min_k Q'_k(s', a')
  critics_.ComputeTdTarget(minibatch_.reward, minibatch_.discount, TargetReduction::kMin, target_);
  // Update critics: theta_k <- argmin mean (Q_k(s, a) - y)^2; and, where it is their turn, update
  // target networks: theta'_k <- tau theta_k + (1 - tau) theta'_k
  UpdateCritics(rate, polyak_rate);
  if (constraint_) constraint_->UpdateCritics(rate * config_.critic_learning_rate, polyak_rate);
  if (!update_actor) return;

  // Deterministic policy gradient, of Q_1 - lambda Q_C where there is a constraint:
  // grad_phi J = mean grad_a Q_1(s, a)|a=pi(s) grad_phi pi(s), and phi' follows as theta'_k does
  totals_.CountActorUpdate();
  CopyActions(actor_.Act(), minibatch_.actions);
  at::Tensor& action_gradient = critics_.ActionGradient(&totals_[Total::kActorQ]);
  if (constraint_) constraint_->AddActionGradient(action_gradient);
  actor_.PolicyGradientStep(action_gradient, config_.preactivation_penalty,
                            rate * config_.actor_learning_rate, polyak_rate, AverageRate(),
                            totals_[Total::kActorNorm]);
}

void Td3::SaveState(nn::TensorMap& tensors) const {
  ActorCritic::SaveState(tensors);
  tensors["td3.target_noise_random"] = StoreRandom(random_);
}

void Td3::LoadState(const nn::TensorFile& file) {
  ActorCritic::LoadState(file);
  ReadRandom(file, "td3.target_noise_random", random_);
}

}  // namespace slalom::learner
