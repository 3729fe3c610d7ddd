#include "learner/td3.h"

#include "learner/stored_state.h"
#include "learner/value_ops.h"

namespace slalom::learner {

Td3::Td3(const AlgorithmContext& context)
    : ActorCritic(context, /*num_critics=*/2),
      random_(base::DeriveSeed(context.seed, "target noise")),
      noise_(context.config.batch_size, context.spec.action_size, context.minibatch.input.device()),
      next_action_(at::zeros_like(context.minibatch.actions)) {}

void Td3::Update(double rate) {
  const bool update_actor = totals_.num_updates() % config_.policy_delay == 0;
  // The lines of Fujimoto et al. 2018, algorithm 1: "if t mod d", under which targets move, too.
  const double polyak_rate = update_actor ? config_.tau : 0.0;
  const at::Tensor& state = minibatch_.features;
  const at::Tensor& next_state = minibatch_.next_features;

  // Target policy smoothing, equation 14: a' = clip(pi'(s') + clip(N(0, sigma), -c, c), -1, 1)
  const at::Tensor& noise = noise_.Draw(random_, config_.target_noise, config_.noise_clip);
  AddClippedNoise(actor_.ActTarget(next_state), noise, next_action_);
  // Clipped double Q-learning, equation 10: y = r + gamma^n min_k Q'_k(s', a')
  critics_.ComputeTdTarget(next_state, next_action_, minibatch_.reward, minibatch_.discount,
                           TargetReduction::kMin, target_);
  // Update critics: theta_k <- argmin mean (Q_k(s, a) - y)^2; and, if it is their turn, update
  // target networks: theta'_k <- tau theta_k + (1 - tau) theta'_k
  UpdateCritics(next_action_, rate, polyak_rate);
  if (!update_actor) return;

  // Deterministic policy gradient, of Q_1 - lambda Q_C if there is a constraint:
  // grad_phi J = mean grad_a Q_1(s, a)|a=pi(s) grad_phi pi(s), and phi' follows as theta'_k does
  totals_.CountActorUpdate();
  const at::Tensor& action = actor_.Act(state);
  at::Tensor& action_gradient = critics_.ActionGradient(state, action, &totals_[Total::kActorQ]);
  if (constraint_) constraint_->AddActionGradient(state, action, action_gradient);
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

std::unique_ptr<Algorithm> MakeTd3(const AlgorithmContext& context) {
  return std::make_unique<Td3>(context);
}

}  // namespace slalom::learner
