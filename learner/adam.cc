#include "learner/adam.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/vector_clones.h"
#include "learner/stored_state.h"
#include "policy/nn/kernels/layer_ops.h"

namespace slalom::learner {
namespace {

constexpr double kBeta1 = 0.9;
constexpr double kBeta2 = 0.999;
constexpr double kEpsilon = 1e-8;

/// Numbers handled at a time: few enough to stay in the L1 cache from the step until the averages
/// are updated.
constexpr std::int64_t kBlock = 1024;

struct StepFactors {
  float step_size;     // learning rate / (1 - beta1^t)
  float moment_scale;  // 1 / sqrt(1 - beta2^t)
};

/// Returns the sum of the squared gradient.
SLALOM_SIMD double StepBlock(const StepFactors factors, std::int64_t n, const float* __restrict g,
                             float* __restrict p, float* __restrict m, float* __restrict v) {
  constexpr float kB1 = static_cast<float>(kBeta1);
  constexpr float kB2 = static_cast<float>(kBeta2);
  constexpr float kC1 = static_cast<float>(1.0 - kBeta1);
  constexpr float kC2 = static_cast<float>(1.0 - kBeta2);
  constexpr float kEps = static_cast<float>(kEpsilon);
  for (std::int64_t i = 0; i < n; ++i) {
    m[i] = kB1 * m[i] + kC1 * g[i];
    v[i] = kB2 * v[i] + kC2 * (g[i] * g[i]);
    p[i] -= factors.step_size * (m[i] / (std::sqrt(v[i]) * factors.moment_scale + kEps));
  }
  float lanes[16] = {};
  std::int64_t i = 0;
  for (; i + 16 <= n; i += 16) {
    for (int j = 0; j < 16; ++j) lanes[j] += g[i + j] * g[i + j];
  }
  for (; i < n; ++i) lanes[0] += g[i] * g[i];
  double sum = 0.0;
  for (const float lane : lanes) sum += lane;
  return sum;
}

SLALOM_SIMD void AddBlock(std::int64_t n, const float* __restrict from, float* __restrict to) {
  for (std::int64_t i = 0; i < n; ++i) to[i] += from[i];
}

SLALOM_SIMD void AverageBlock(float rate, std::int64_t n, const float* __restrict p,
                              float* __restrict average) {
  for (std::int64_t i = 0; i < n; ++i) average[i] += rate * (p[i] - average[i]);
}

}  // namespace

Adam::Adam(at::Tensor parameters, const at::Tensor& gradients, base::ParallelFor* parallel)
    : parameters_(std::move(parameters)),
      gradients_(gradients.view({-1, parameters_.numel()}).unbind()),
      first_moment_(at::zeros_like(parameters_)),
      second_moment_(at::zeros_like(parameters_)),
      parallel_(parallel),
      squared_norms_(static_cast<std::size_t>((parameters_.numel() + kBlock - 1) / kBlock)) {}

void Adam::Step(double learning_rate, std::span<const PolyakAverage> averages,
                at::Tensor& norm_total, int num_gradients) {
  SLALOM_CHECK_LE(static_cast<std::size_t>(num_gradients), gradients_.size());
  const std::span others = std::span(gradients_).subspan(1, num_gradients - 1);
  ++num_steps_;
  const double t = static_cast<double>(num_steps_);
  const double step_size = learning_rate / (1.0 - std::pow(kBeta1, t));
  const double moment_scale = 1.0 / std::sqrt(1.0 - std::pow(kBeta2, t));
  if (!nn::IsHostFloat(parameters_)) {
    at::Tensor& gradient = gradients_.front();
    for (const at::Tensor& other : others) gradient.add_(other);
    norm_total.add_(gradient.norm());
    first_moment_.mul_(kBeta1).add_(gradient, 1.0 - kBeta1);
    second_moment_.mul_(kBeta2).addcmul_(gradient, gradient, 1.0 - kBeta2);
    const at::Tensor denominator = second_moment_.sqrt().mul_(moment_scale).add_(kEpsilon);
    parameters_.addcdiv_(first_moment_, denominator, -step_size);
    for (const PolyakAverage& average : averages) {
      at::Tensor values = average.values;
      values.lerp_(parameters_, average.rate);
    }
    return;
  }
  const StepFactors factors{static_cast<float>(step_size), static_cast<float>(moment_scale)};
  float* const g = gradients_.front().data_ptr<float>();
  float* const p = parameters_.data_ptr<float>();
  float* const m = first_moment_.data_ptr<float>();
  float* const v = second_moment_.data_ptr<float>();
  const std::int64_t size = parameters_.numel();
  base::For(parallel_, static_cast<int>(squared_norms_.size()), [&](int block) {
    const std::int64_t begin = block * kBlock;
    const std::int64_t n = std::min(kBlock, size - begin);
    for (const at::Tensor& other : others) {
      AddBlock(n, other.data_ptr<float>() + begin, g + begin);
    }
    squared_norms_[block] = StepBlock(factors, n, g + begin, p + begin, m + begin, v + begin);
    for (const PolyakAverage& average : averages) {
      AverageBlock(static_cast<float>(average.rate), n, p + begin,
                   average.values.data_ptr<float>() + begin);
    }
  });
  double squared_norm = 0.0;
  for (const double block : squared_norms_) squared_norm += block;
  *norm_total.data_ptr<double>() += std::sqrt(squared_norm);
  // Autograd then refuses to differentiate results of the old parameters.
  parameters_.unsafeGetTensorImpl()->bump_version();
}

void Adam::SaveState(const std::string& prefix, nn::TensorMap& tensors) const {
  tensors[prefix + ".first_moment"] = StoreTensor(first_moment_);
  tensors[prefix + ".second_moment"] = StoreTensor(second_moment_);
  tensors[prefix + ".num_steps"] =
      nn::StoredTensor::Of(std::span<const std::int64_t>(&num_steps_, 1));
}

void Adam::LoadState(const std::string& prefix, const nn::TensorFile& file) {
  ReadTensor(file, prefix + ".first_moment", first_moment_);
  ReadTensor(file, prefix + ".second_moment", second_moment_);
  file.Read(prefix + ".num_steps", std::span(&num_steps_, 1));
}

}  // namespace slalom::learner
