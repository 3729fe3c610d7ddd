#include "learner/gaussian_ops.h"

#include <ATen/ATen.h>

#include <cmath>
#include <numbers>

#include "policy/nn/kernels/layer_ops.h"

namespace slalom::learner {
namespace {

using nn::IsHostFloat;

const double kLogSqrtTwoPi = 0.5 * std::log(2.0 * std::numbers::pi);

/// Returns log(1 - tanh(u)^2) without cancellation for large |u|.
float LogTanhSlope(float u) {
  const float v = -2.0f * std::abs(u);
  return 2.0f * (std::numbers::ln2_v<float> + 0.5f * v - std::log1p(std::exp(v)));
}

/// Returns log std from the second half of the network's outputs.
at::Tensor LogStd(const policy::ActionDistribution& distribution, const at::Tensor& raw) {
  return distribution.log_std_min +
         0.5 * (distribution.log_std_max - distribution.log_std_min) * (raw.tanh() + 1.0);
}

}  // namespace

DrawnActions SquashedDraw(const policy::ActionDistribution& distribution, const at::Tensor& output,
                          const at::Tensor& noise) {
  const std::int64_t size = noise.size(1);
  const at::Tensor log_std = LogStd(distribution, output.narrow(1, size, size));
  const at::Tensor u = output.narrow(1, 0, size) + log_std.exp() * noise;
  const at::Tensor log_slope = 2.0 * (std::numbers::ln2 - u - at::softplus(-2.0 * u));
  return {u.tanh(), (-0.5 * noise.square() - log_std - kLogSqrtTwoPi - log_slope).sum(1)};
}

void SquashedSample(const policy::ActionDistribution& distribution, const at::Tensor& output,
                    const at::Tensor& noise, at::Tensor& actions, at::Tensor& log_probability) {
  if (!IsHostFloat(output)) {
    const DrawnActions drawn = SquashedDraw(distribution, output, noise);
    actions.copy_(drawn.action);
    log_probability.copy_(drawn.log_probability);
    return;
  }
  const std::int64_t size = actions.size(1);
  const float* const row = output.data_ptr<float>();
  const float* const random = noise.data_ptr<float>();
  float* const action = actions.data_ptr<float>();
  for (std::int64_t i = 0; i < output.size(0); ++i) {
    float sum = 0.0f;
    for (std::int64_t j = 0; j < size; ++j) {
      const float log_std = distribution.log_std(row[i * 2 * size + size + j]);
      const float epsilon = random[i * size + j];
      const float u = row[i * 2 * size + j] + std::exp(log_std) * epsilon;
      action[i * size + j] = std::tanh(u);
      sum +=
          -0.5f * epsilon * epsilon - log_std - static_cast<float>(kLogSqrtTwoPi) - LogTanhSlope(u);
    }
    log_probability.data_ptr<float>()[i] = sum;
  }
}

void SquashedGradient(const policy::ActionDistribution& distribution, const at::Tensor& output,
                      const at::Tensor& noise, const at::Tensor& actions, const at::Tensor& daction,
                      const at::Tensor& log_temperature, at::Tensor& doutput) {
  const std::int64_t size = actions.size(1);
  const double half_range = 0.5 * (distribution.log_std_max - distribution.log_std_min);
  const auto batch = static_cast<double>(output.size(0));
  if (!IsHostFloat(output)) {
    const at::Tensor share = log_temperature.exp() / batch;
    const at::Tensor raw = output.narrow(1, size, size);
    const at::Tensor du = daction * (1.0 - actions.square()) + share * 2.0 * actions;
    doutput.narrow(1, 0, size).copy_(du);
    doutput.narrow(1, size, size)
        .copy_((du * LogStd(distribution, raw).exp() * noise - share) * half_range *
               (1.0 - raw.tanh().square()));
    return;
  }
  const auto share =
      static_cast<float>(std::exp(static_cast<double>(*log_temperature.data_ptr<float>())) / batch);
  const float* const row = output.data_ptr<float>();
  const float* const random = noise.data_ptr<float>();
  const float* const action = actions.data_ptr<float>();
  float* const result = doutput.data_ptr<float>();
  for (std::int64_t i = 0; i < output.size(0); ++i) {
    const float* const by_action = daction.data_ptr<float>() + i * daction.stride(0);
    for (std::int64_t j = 0; j < size; ++j) {
      const std::int64_t mean = i * 2 * size + j;
      const float a = action[i * size + j];
      const float raw = row[mean + size];
      const float slope = std::tanh(raw);
      const float du = by_action[j] * (1.0f - a * a) + share * 2.0f * a;
      result[mean] = du;
      result[mean + size] =
          (du * std::exp(distribution.log_std(raw)) * random[i * size + j] - share) *
          static_cast<float>(half_range) * (1.0f - slope * slope);
    }
  }
}

void AddEntropyBonus(const at::Tensor& discount, const at::Tensor& log_temperature,
                     const at::Tensor& log_probability, at::Tensor& y) {
  if (!IsHostFloat(y)) {
    y.sub_(discount * log_temperature.exp() * log_probability);
    return;
  }
  const float alpha = std::exp(*log_temperature.data_ptr<float>());
  for (std::int64_t i = 0; i < y.numel(); ++i) {
    y.data_ptr<float>()[i] -=
        discount.data_ptr<float>()[i] * alpha * log_probability.data_ptr<float>()[i];
  }
}

void TemperatureGradient(const at::Tensor& log_probability, double target_entropy,
                         at::Tensor& gradient, at::Tensor& entropy_total) {
  if (!IsHostFloat(log_probability)) {
    const at::Tensor mean = log_probability.mean();
    entropy_total.sub_(mean);
    gradient.copy_(-(mean + target_entropy).unsqueeze(0));
    return;
  }
  double sum = 0.0;
  for (std::int64_t i = 0; i < log_probability.numel(); ++i) {
    sum += log_probability.data_ptr<float>()[i];
  }
  const double mean = sum / static_cast<double>(log_probability.numel());
  *entropy_total.data_ptr<double>() -= mean;
  *gradient.data_ptr<float>() = static_cast<float>(-(mean + target_entropy));
}

}  // namespace slalom::learner
