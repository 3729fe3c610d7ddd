#include "learner/value_ops.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "learner/gaussian_ops.h"

namespace slalom::learner {
namespace {

/// Random numbers as [rows, columns], columns of a wider matrix.
at::Tensor Draw(std::int64_t rows, std::int64_t columns, base::Random& random) {
  at::Tensor matrix = at::zeros({rows, columns}, at::kDouble);
  double* const values = matrix.data_ptr<double>();
  for (std::int64_t i = 0; i < matrix.numel(); ++i) values[i] = random.Uniform(-2.0, 2.0);
  return matrix;
}

/// The fused kernels (float32) against LibTorch's operations (float64): a few roundings of numbers
/// below 10.
constexpr double kTolerance = 10 * 4 * 0x1p-24;

double Difference(const at::Tensor& a, const at::Tensor& b) {
  return (a.to(at::kDouble) - b).abs().max().item<double>();
}

TEST(ValueOps, KernelsDoWhatTheOperationsDo) {
  base::Random random(1);
  const at::Tensor from = Draw(17, 2, random), noise = Draw(17, 2, random);
  const at::Tensor q1 = Draw(17, 1, random), q2 = Draw(17, 1, random);
  const at::Tensor reward = Draw(1, 17, random)[0], discount = Draw(1, 17, random)[0];
  const auto compute = [&](at::ScalarType type) {
    std::vector<at::Tensor> results;
    at::Tensor wide = at::zeros({17, 6}, type);
    at::Tensor copied = wide.narrow(1, 1, 2), noisy = wide.narrow(1, 4, 2);
    CopyActions(from.to(type), copied);
    AddClippedNoise(from.to(type), noise.to(type), noisy);
    at::Tensor y = at::zeros({17}, type), dq = at::zeros({17, 1}, type);
    const std::array<at::Tensor, 2> values = {q1.to(type), q2.to(type)};
    TdTarget(values, TargetReduction::kMin, reward.to(type), discount.to(type), y);
    at::Tensor y_max = at::zeros({17}, type);
    TdTarget(values, TargetReduction::kMax, reward.to(type), discount.to(type), y_max);
    at::Tensor loss = at::ones({1}, at::kDouble), mean = at::ones({1}, at::kDouble);
    SquaredError(values[0], y, dq, loss, mean);
    AddMean(values[1], mean);
    std::array<at::Tensor, 2> by_value = {at::zeros({17, 1}, type), at::zeros({17, 1}, type)};
    MinGradient(values, by_value, mean);
    at::Tensor weighed = dq.clone(), error = at::ones({17}, type);
    ApplyImportanceWeights(values[0], y, discount.to(type), 0.25, weighed, error);
    return std::vector<at::Tensor>{wide, y,           y_max,       dq,      loss,
                                   mean, by_value[0], by_value[1], weighed, error};
  };
  const auto fused = compute(at::kFloat);
  const auto expected = compute(at::kDouble);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    EXPECT_LE(Difference(fused[i], expected[i]), kTolerance) << "result " << i;
    EXPECT_GT(expected[i].abs().max().item<double>(), 0.0);
  }
}

TEST(GaussianOps, KernelsDoWhatTheOperationsDo) {
  base::Random random(2);
  const policy::ActionDistribution distribution = {policy::DistributionKind::kGaussian, -3.0, 1.0};
  const at::Tensor output = Draw(17, 4, random), noise = Draw(17, 2, random);
  const at::Tensor daction = Draw(17, 2, random), discount = Draw(1, 17, random)[0];
  const auto compute = [&](at::ScalarType type) {
    at::Tensor actions = at::zeros({17, 2}, type), log_probability = at::zeros({17}, type);
    SquashedSample(distribution, output.to(type), noise.to(type), actions, log_probability);
    at::Tensor doutput = at::zeros({17, 4}, type);
    const at::Tensor log_temperature = at::full({1}, -0.5, type);
    SquashedGradient(distribution, output.to(type), noise.to(type), actions, daction.to(type),
                     log_temperature, doutput);
    at::Tensor y = at::ones({17}, type), gradient = at::zeros({1}, type);
    AddEntropyBonus(discount.to(type), log_temperature, log_probability, y);
    at::Tensor entropy = at::ones({1}, at::kDouble);
    TemperatureGradient(log_probability, -2.0, gradient, entropy);
    return std::vector<at::Tensor>{actions, log_probability, doutput, y, gradient, entropy};
  };
  const auto fused = compute(at::kFloat);
  const auto expected = compute(at::kDouble);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    // Logarithms and exponentials of numbers up to 8.
    EXPECT_LE(Difference(fused[i], expected[i]), 10 * kTolerance) << "result " << i;
    EXPECT_GT(expected[i].abs().max().item<double>(), 0.0);
  }
}

// tanh of a large number is 1 in float32, and the logarithm of 1 - tanh^2 would be infinite.
TEST(GaussianOps, DensityStaysFiniteWhereTanhSaturates) {
  const at::Tensor output = at::full({1, 4}, 30.0f), noise = at::zeros({1, 2});
  at::Tensor actions = at::zeros({1, 2}), log_probability = at::zeros({1});
  SquashedSample({policy::DistributionKind::kGaussian, -1.0, 1.0}, output, noise, actions,
                 log_probability);
  EXPECT_EQ(actions[0][0].item<float>(), 1.0f);
  // -log(1 - tanh(u)^2) is 2 u - log 4 for large u; the deviation is e there.
  const double each = -1.0 - 0.5 * std::log(2.0 * M_PI) + 60.0 - std::log(4.0);
  EXPECT_NEAR(log_probability.item<float>(), 2.0 * each, 1e-4);
}

}  // namespace
}  // namespace slalom::learner
