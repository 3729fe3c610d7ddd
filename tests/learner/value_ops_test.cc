#include "learner/value_ops.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"

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
    MinimumTarget(values, reward.to(type), discount.to(type), y);
    at::Tensor loss = at::ones({1}, at::kDouble), mean = at::ones({1}, at::kDouble);
    SquaredError(values[0], y, dq, loss, mean);
    AddMean(values[1], mean);
    at::Tensor weighed = dq.clone(), error = at::ones({17}, type);
    WeighError(values[0], y, discount.to(type), 0.25, weighed, error);
    return std::vector<at::Tensor>{wide, y, dq, loss, mean, weighed, error};
  };
  const auto fused = compute(at::kFloat);
  const auto expected = compute(at::kDouble);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    EXPECT_LE(Difference(fused[i], expected[i]), kTolerance) << "result " << i;
    EXPECT_GT(expected[i].abs().max().item<double>(), 0.0);
  }
}

}  // namespace
}  // namespace slalom::learner
