#include "learner/sac.h"

#include <ATen/ATen.h>

#include <cmath>

#include "learner/stored_state.h"
#include "learner/value_ops.h"

namespace slalom::learner {

Sac::Sac(const AlgorithmContext& context, int num_critics, int critic_outputs)
    : ActorCritic(context, num_critics, critic_outputs),
      random_(base::DeriveSeed(context.seed, "policy noise")),
      next_random_(base::DeriveSeed(context.seed, "next policy noise")),
      noise_(context.config.batch_size, context.spec.action_size, context.minibatch.input.device()),
      next_noise_(context.config.batch_size, context.spec.action_size,
                  context.minibatch.input.device()),
      log_temperature_(
          at::full({1}, std::log(context.config.temperature), context.minibatch.reward.options())),
      log_temperature_gradient_(at::zeros_like(log_temperature_)),
      temperature_adam_(log_temperature_, log_temperature_gradient_),
      temperature_norm_(at::zeros_like(log_temperature_, at::kDouble)) {}

void Sac::Update(double rate) {
  totals_.CountActorUpdate();
  const at::Tensor& state = minibatch_.features;
  const at::Tensor& next_state = minibatch_.next_features;

  // a', log pi(a'|s') ~ pi(.|s')
  const auto& [next_action, next_log_probability] =
      actor_.SampleNext(next_state, next_noise_.Draw(next_random_));
  // Soft value, equations 3 and 6: y = r + gamma^n (min_k Q'_k(s', a') - alpha log pi(a'|s'))
  critics_.ComputeTdTarget(next_state, next_action, minibatch_.reward, minibatch_.discount,
                           TargetReduction::kMin, target_);
  AddEntropyBonus(minibatch_.discount, log_temperature_, next_log_probability, target_);
  // Equation 5: theta_k <- argmin mean (Q_k(s, a) - y)^2;
  // theta'_k <- tau theta_k + (1 - tau) theta'_k
  UpdateCritics(next_action, rate, config_.tau);

  // Equation 9: phi <- argmin mean alpha log pi(a|s) - min_k Q_k(s, a), a reparametrised
  const auto& [action, log_probability] = actor_.Sample(state, noise_.Draw(random_));
  at::Tensor& action_gradient = critics_.MinActionGradient(state, action, totals_[Total::kActorQ]);
  if (constraint_) constraint_->AddActionGradient(state, action, action_gradient);
  actor_.PolicyGradientStep(action_gradient, log_temperature_, rate * config_.actor_learning_rate,
                            AverageRate(), totals_[Total::kActorNorm]);

  UpdateTemperature(log_probability);
}

void Sac::UpdateTemperature(const at::Tensor& log_probability) {
  TemperatureGradient(log_probability, config_.target_entropy, log_temperature_gradient_,
                      totals_[Total::kEntropy]);
  if (config_.temperature_learning_rate > 0.0) {
    temperature_adam_.Step(config_.temperature_learning_rate, {}, temperature_norm_);
  }
}

void Sac::Describe(LearnerStats& stats) const {
  stats.temperature = std::exp(log_temperature_.item<double>());
}

void Sac::SaveState(nn::TensorMap& tensors) const {
  ActorCritic::SaveState(tensors);
  tensors["sac.policy_noise_random"] = StoreRandom(random_);
  tensors["sac.next_policy_noise_random"] = StoreRandom(next_random_);
  tensors["sac.log_temperature"] = StoreTensor(log_temperature_);
  temperature_adam_.SaveState("sac.temperature_adam", tensors);
}

void Sac::LoadState(const nn::TensorFile& file) {
  ActorCritic::LoadState(file);
  ReadRandom(file, "sac.policy_noise_random", random_);
  ReadRandom(file, "sac.next_policy_noise_random", next_random_);
  ReadTensor(file, "sac.log_temperature", log_temperature_);
  temperature_adam_.LoadState("sac.temperature_adam", file);
}

std::unique_ptr<Algorithm> MakeSac(const AlgorithmContext& context) {
  return std::make_unique<Sac>(context);
}

}  // namespace slalom::learner
