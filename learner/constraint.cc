#include "learner/constraint.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/check.h"
#include "learner/value_ops.h"

namespace slalom::learner {

Constraint::Constraint(const ConstraintConfig& config, const nn::NetworkShape& critic_shape,
                       base::Random& initial_weights, Minibatch& minibatch, Totals& totals)
    : config_(config),
      minibatch_(minibatch),
      totals_(totals),
      critics_("cost_critics", critic_shape, kNumCritics, initial_weights, minibatch),
      target_(at::zeros_like(minibatch.cost)),
      td_errors_(at::zeros_like(minibatch.cost)),
      integral_(config.multiplier),
      multiplier_(config.multiplier) {
  SLALOM_CHECK(config.kind != ConstraintKind::kNone);
}

void Constraint::UpdateCritics(const at::Tensor& next_action, double learning_rate,
                               double polyak_rate) {
  critics_.ComputeTdTarget(minibatch_.next_features, next_action, minibatch_.cost,
                           minibatch_.discount, TargetReduction::kMax, target_);
  // Samples are drawn by the TD errors of the reward critics; the same importance weights apply.
  const Critics::Importance importance{minibatch_.weight, td_errors_};
  critics_.GradientStep(minibatch_.features, minibatch_.actions, target_, learning_rate,
                        polyak_rate, totals_[Total::kCostLoss], totals_[Total::kCostQ],
                        totals_[Total::kCostNorm], &importance);
}

void Constraint::AddActionGradient(const at::Tensor& state, const at::Tensor& action,
                                   at::Tensor& action_gradient) {
  // `Critics` gives the gradient of -mean Q.
  action_gradient.sub_(critics_.ActionGradient(state, action, nullptr), multiplier_);
}

at::Tensor Constraint::Penalty(const at::Tensor& state, const at::Tensor& action) const {
  return multiplier_ * critics_.Values(state, action).select(1, 0).mean();
}

void Constraint::Observe(double mean_cost, std::int64_t finished) {
  if (finished <= 0 || std::isnan(mean_cost)) return;
  num_episodes_ += finished;
  const double rise = std::isnan(mean_cost_) ? 0.0 : std::max(0.0, mean_cost - mean_cost_);
  mean_cost_ = mean_cost;
  if (config_.kind == ConstraintKind::kFixed ||
      static_cast<double>(num_episodes_) < config_.learning_starts) {
    return;
  }
  // Stooke et al. 2020, algorithm 2, once for each episode: lambda <- [K_P Delta + I + K_D rise]_+,
  // I <- [I + K_I Delta]_+.
  const double violation = mean_cost - config_.limit;
  integral_ =
      std::clamp(integral_ + static_cast<double>(finished) * config_.learning_rate * violation, 0.0,
                 config_.multiplier_max);
  multiplier_ =
      std::clamp(config_.proportional_gain * violation + integral_ + config_.derivative_gain * rise,
                 0.0, config_.multiplier_max);
}

void Constraint::Describe(LearnerStats& stats) const {
  stats.constraint_multiplier = multiplier_;
  stats.constraint_violation = mean_cost_ - config_.limit;
}

void Constraint::SaveState(nn::TensorMap& tensors) const {
  critics_.SaveState(tensors);
  const std::array numbers = {integral_, multiplier_, mean_cost_};
  tensors["constraint.state"] = nn::StoredTensor::Of(std::span<const double>(numbers));
  const std::array episodes = {num_episodes_};
  tensors["constraint.episodes"] = nn::StoredTensor::Of(std::span<const std::int64_t>(episodes));
}

void Constraint::LoadState(const nn::TensorFile& file) {
  critics_.LoadState(file);
  std::array<double, 3> numbers{};
  file.Read("constraint.state", std::span(numbers));
  integral_ = numbers[0];
  multiplier_ = numbers[1];
  mean_cost_ = numbers[2];
  std::array<std::int64_t, 1> episodes{};
  file.Read("constraint.episodes", std::span(episodes));
  num_episodes_ = episodes[0];
}

}  // namespace slalom::learner
