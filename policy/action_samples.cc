#include "policy/action_samples.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace slalom::policy {
namespace {

constexpr float kLeastDeviation = 0.01f;

/// Sets one number of a step's plan to mean and deviation of that number in the samples.
void FitNumber(std::span<const env::Action> actions, std::span<const float> weights,
               float env::Action::*number, env::Action& mean, env::Action& deviation) {
  double sum = 0.0, squares = 0.0;
  for (std::size_t s = 0; s < actions.size(); ++s) {
    const double value = actions[s].*number;
    sum += static_cast<double>(weights[s]) * value;
    squares += static_cast<double>(weights[s]) * value * value;
  }
  mean.*number = static_cast<float>(sum);
  deviation.*number =
      std::max(kLeastDeviation, static_cast<float>(std::sqrt(std::max(0.0, squares - sum * sum))));
}

}  // namespace

ActionSamples::ActionSamples(int horizon, int size)
    : actions(static_cast<std::size_t>(horizon) * size),
      returns(size),
      weights(size),
      order(size) {}

env::Action DrawAround(const env::Action& centre, const env::Action& deviation,
                       base::Random& random) {
  // One after the other, as the order of draws is part of a seed's meaning.
  const float linear = deviation.linear * static_cast<float>(random.Normal());
  const float angular = deviation.angular * static_cast<float>(random.Normal());
  return {std::clamp(centre.linear + linear, -1.0f, 1.0f),
          std::clamp(centre.angular + angular, -1.0f, 1.0f)};
}

void WeighByReturn(double temperature, ActionSamples& samples) {
  const double best = *std::max_element(samples.returns.begin(), samples.returns.end());
  double sum = 0.0;
  for (std::size_t s = 0; s < samples.returns.size(); ++s) {
    const double weight = std::exp((static_cast<double>(samples.returns[s]) - best) / temperature);
    samples.weights[s] = static_cast<float>(weight);
    sum += weight;
  }
  for (float& weight : samples.weights) {
    weight = static_cast<float>(static_cast<double>(weight) / sum);
  }
}

void WeighTheBest(int num_best, ActionSamples& samples) {
  std::iota(samples.order.begin(), samples.order.end(), 0);
  std::stable_sort(samples.order.begin(), samples.order.end(),
                   [&](int a, int b) { return samples.returns[a] > samples.returns[b]; });
  std::fill(samples.weights.begin(), samples.weights.end(), 0.0f);
  for (const int s : std::span(samples.order).first(num_best)) {
    samples.weights[s] = 1.0f / static_cast<float>(num_best);
  }
}

void FitPlan(const ActionSamples& samples, ActionPlan& plan) {
  for (std::size_t t = 0; t < plan.mean.size(); ++t) {
    for (const auto number : {&env::Action::linear, &env::Action::angular}) {
      FitNumber(samples.At(static_cast<int>(t)), samples.weights, number, plan.mean[t],
                plan.deviation[t]);
    }
  }
}

int DrawSequence(const ActionSamples& samples, base::Random& random) {
  const double quantile = random.Uniform();
  double sum = 0.0;
  for (std::size_t s = 0; s < samples.weights.size(); ++s) {
    sum += static_cast<double>(samples.weights[s]);
    if (quantile < sum) return static_cast<int>(s);
  }
  return static_cast<int>(samples.weights.size()) - 1;
}

}  // namespace slalom::policy
