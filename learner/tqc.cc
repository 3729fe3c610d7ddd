#include <ATen/ATen.h>

#include <memory>
#include <tuple>
#include <vector>

#include "learner/sac.h"

/// Shapes: `B` batch, `K` critics, `M` quantiles of each, `T` quantiles of the target.

namespace slalom::learner {
namespace {

/// The loss of quantile regression for one critic, the mean over i and m of |tau_m - 1(u < 0)| L(u)
/// with u = y_i - z_m, tau_m = (2 m - 1) / (2 M) and Huber's L(u) = u^2 / 2 if |u| < 1, else
/// |u| - 1/2. z: [B, M]; y: [B, T]. Returns [B].
at::Tensor QuantileHuberLoss(const at::Tensor& z, const at::Tensor& y) {
  const std::int64_t m = z.size(1);
  const at::Tensor tau = ((at::arange(m, z.options()) + 0.5) / static_cast<double>(m)).unsqueeze(1);
  const std::vector<at::Tensor> pairs = at::broadcast_tensors({z.unsqueeze(2), y.unsqueeze(1)});
  const at::Tensor weight = at::where(pairs[1] < pairs[0], 1.0 - tau, tau);  // [B, M, T]
  return (weight * at::smooth_l1_loss(pairs[0], pairs[1], at::Reduction::None)).mean({1, 2});
}

/// Truncated Quantile Critics (Kuznetsov et al. 2020, algorithm 1): Soft Actor-Critic whose K
/// critics give M quantiles of the return each, and whose target leaves out the largest of all.
class Tqc : public Sac {
 public:
  explicit Tqc(const AlgorithmContext& context)
      : Sac(context, context.config.quantile_critics, context.config.quantiles) {}

  void Update(double rate) override {
    totals_.CountActorUpdate();
    const at::Tensor& state = minibatch_.features;
    const at::Tensor& next_state = minibatch_.next_features;
    const at::Tensor alpha = log_temperature_.exp();

    // a', log pi(a'|s') ~ pi(.|s')
    const auto& [next_action, next_log_probability] =
        actor_.SampleNext(next_state, next_noise_.Draw(next_random_));
    // y_i = r + gamma^n (z_(i)(s', a') - alpha log pi(a'|s')), where z_(1) <= z_(2) <= ... are the
    // quantiles of all target critics together, without the d K largest
    const at::Tensor pooled = critics_.TargetValues(next_state, next_action).flatten(1);
    const std::int64_t num_kept = pooled.size(1) - critics_.size() * config_.dropped_quantiles;
    const at::Tensor kept = std::get<0>(pooled.sort(1)).narrow(1, 0, num_kept);
    const at::Tensor bonus = alpha * next_log_probability;
    const at::Tensor y = minibatch_.reward.unsqueeze(1) +
                         minibatch_.discount.unsqueeze(1) * (kept - bonus.unsqueeze(1));
    // theta_k <- argmin mean rho_tau_m(y_i - z_k,m(s, a)); theta'_k <- tau theta_k + (1-tau)
    // theta'_k
    const at::Tensor z = critics_.Values(state, minibatch_.actions);
    at::Tensor loss = at::zeros({}, z.options());
    for (const at::Tensor& z_k : z.unbind(1)) {
      loss = loss + (minibatch_.weight * QuantileHuberLoss(z_k, y)).mean();
    }
    critics_.Descend(loss, rate * config_.critic_learning_rate, config_.tau,
                     totals_[Total::kCriticNorm]);
    if (constraint_) {
      constraint_->UpdateCritics(next_action, rate * config_.critic_learning_rate, config_.tau);
    }

    // phi <- argmin mean alpha log pi(a|s) - mean_k,m z_k,m(s, a), a reparametrised
    const auto [action, log_probability] = actor_.Draw(state, noise_.Draw(random_));
    const at::Tensor q = critics_.Values(state, action).mean({1, 2});
    at::Tensor actor_loss = (alpha * log_probability - q).mean();
    if (constraint_) actor_loss = actor_loss + constraint_->Penalty(state, action);
    actor_.Descend(actor_loss, rate * config_.actor_learning_rate, AverageRate(),
                   totals_[Total::kActorNorm]);
    UpdateTemperature(log_probability.detach());

    const at::Tensor mean = z.detach().mean(2);  // [B, K]
    td_errors_.copy_((mean - y.mean(1, /*keepdim=*/true)).abs().mean(1));
    totals_[Total::kCriticLoss].add_(loss.detach());
    totals_[Total::kQ].add_(mean.mean() * critics_.size());
    totals_[Total::kActorQ].add_(q.detach().mean());
  }
};

}  // namespace

std::unique_ptr<Algorithm> MakeTqc(const AlgorithmContext& context) {
  return std::make_unique<Tqc>(context);
}

}  // namespace slalom::learner
