#include "learner/ddpg.h"

#include "learner/value_ops.h"

namespace slalom::learner {

void Ddpg::Update(double rate) {
  totals_.CountActorUpdate();
  const at::Tensor& state = minibatch_.features;
  const at::Tensor& next_state = minibatch_.next_features;

  // The lines of Lillicrap et al. 2016, algorithm 1, from "Set y_i" on.
  // Set y_i, equation 5: y = r + gamma^n Q'(s', pi'(s'))
  const at::Tensor& next_action = actor_.ActTarget(next_state);
  critics_.ComputeTdTarget(next_state, next_action, minibatch_.reward, minibatch_.discount,
                           TargetReduction::kMin, target_);
  // Update critic, equation 4: theta <- argmin mean (Q(s, a) - y)^2; with it the update of its
  // target network, theta' <- tau theta + (1 - tau) theta', which nothing reads until the next y
  UpdateCritics(next_action, rate, config_.tau);

  // Update the actor by the sampled policy gradient, equation 6, of Q - lambda Q_C if there is a
  // constraint: grad_phi J = mean grad_a Q(s, a)|a=pi(s) grad_phi pi(s), and phi' follows as theta'
  // does
  const at::Tensor& action = actor_.Act(state);
  at::Tensor& action_gradient = critics_.ActionGradient(state, action, &totals_[Total::kActorQ]);
  if (constraint_) constraint_->AddActionGradient(state, action, action_gradient);
  actor_.PolicyGradientStep(action_gradient, config_.preactivation_penalty,
                            rate * config_.actor_learning_rate, config_.tau, AverageRate(),
                            totals_[Total::kActorNorm]);
}

std::unique_ptr<Algorithm> MakeDdpg(const AlgorithmContext& context) {
  return std::make_unique<Ddpg>(context);
}

}  // namespace slalom::learner
