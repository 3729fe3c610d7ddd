#include "learner/model_loss.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "base/vector_clones.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/smooth_math.h"

namespace slalom::learner {
namespace {

constexpr double kHalfLog2Pi = 0.91893853320467274;
/// Half widths of the middle 50 % and 90 % of a normal distribution, in standard deviations.
constexpr float kHalf50 = 0.67448975f;
constexpr float kHalf90 = 1.64485363f;

/// Number of partial sums, so that sums vectorise in an order that is always the same.
constexpr std::int64_t kLanes = 16;

inline double LaneSum(const float (&lanes)[kLanes]) {
  double sum = 0.0;
  for (const float lane : lanes) sum += static_cast<double>(lane);
  return sum;
}

/// Computes error = target - mean. The network predicts the mean of the next frame or of its change
/// from `newest`. Returns the sum of squares.
SLALOM_SIMD double Errors(bool difference, std::int64_t n, const float* __restrict newest,
                          const float* __restrict next, const float* __restrict mean,
                          float* __restrict error) {
  const float share = difference ? 1.0f : 0.0f;
  float lanes[kLanes] = {};
  std::int64_t j = 0;
  for (; j + kLanes <= n; j += kLanes) {
    for (std::int64_t l = 0; l < kLanes; ++l) {
      const float e = (next[j + l] - share * newest[j + l]) - mean[j + l];
      error[j + l] = e;
      lanes[l] += e * e;
    }
  }
  for (; j < n; ++j) {
    error[j] = (next[j] - share * newest[j]) - mean[j];
    lanes[0] += error[j] * error[j];
  }
  return LaneSum(lanes);
}

SLALOM_SIMD double ChangeSquares(std::int64_t n, const float* __restrict newest,
                                 const float* __restrict next) {
  float lanes[kLanes] = {};
  for (std::int64_t j = 0; j < n; ++j) {
    const float change = next[j] - newest[j];
    lanes[j % kLanes] += change * change;
  }
  return LaneSum(lanes);
}

SLALOM_SIMD void Scale(float factor, std::int64_t n, float* __restrict values) {
  for (std::int64_t j = 0; j < n; ++j) values[j] *= factor;
}

/// Turns `d` = error into the gradient with respect to the mean, -z / sigma, and computes the one
/// with respect to the logarithm of sigma, 1 - z^2. Returns the sum of ln sigma + z^2 / 2.
SLALOM_SIMD double LikelihoodGradient(std::int64_t n, const float* __restrict log_std,
                                      float* __restrict d, float* __restrict d_log_std) {
  float lanes[kLanes] = {};
  std::int64_t j = 0;
  for (; j + kLanes <= n; j += kLanes) {
    for (std::int64_t l = 0; l < kLanes; ++l) {
      const float inverse = nn::SmoothExp(-log_std[j + l]);
      const float z = d[j + l] * inverse;
      d[j + l] = -z * inverse;
      d_log_std[j + l] = 1.0f - z * z;
      lanes[l] += log_std[j + l] + 0.5f * (z * z);
    }
  }
  for (; j < n; ++j) {
    const float inverse = nn::SmoothExp(-log_std[j]);
    const float z = d[j] * inverse;
    d[j] = -z * inverse;
    d_log_std[j] = 1.0f - z * z;
    lanes[0] += log_std[j] + 0.5f * (z * z);
  }
  return LaneSum(lanes);
}

/// Propagates a gradient back through low + half (1 + tanh raw).
SLALOM_SIMD void BoundGradient(float low, float half, std::int64_t n,
                               const float* __restrict log_std, float* __restrict d) {
  for (std::int64_t j = 0; j < n; ++j) {
    const float t = (log_std[j] - low) / half - 1.0f;
    d[j] *= half * (1.0f - t * t);
  }
}

SLALOM_SIMD void TanhGradient(std::int64_t n, const float* __restrict y, float* __restrict d) {
  for (std::int64_t j = 0; j < n; ++j) d[j] *= 1.0f - y[j] * y[j];
}

/// Counts the values of 1 - z^2 for which |z| < `half`.
std::int64_t CountInside(float half, std::int64_t n, const float* d_log_std) {
  const float least = 1.0f - half * half;
  return std::count_if(d_log_std, d_log_std + n, [&](float value) { return value > least; });
}

/// The same with LibTorch's operations.
void ReferenceLoss(const nn::ModelShape& shape, const ModelTargets& targets, double state_scale,
                   nn::ModelPass& pass, at::Tensor& figures) {
  const std::int64_t n = shape.num_predicted;
  const std::int64_t begin = shape.network.num_inputs() - shape.frame_size();
  const at::Tensor output = pass.output();
  const at::Tensor mean = output.narrow(1, 0, n);
  const at::Tensor newest = targets.features.narrow(1, begin, n);
  const at::Tensor next = targets.next_features.narrow(1, begin, n);
  const at::Tensor error = (shape.difference ? next - newest : next) - mean;
  const at::Tensor weight = targets.weight;
  const at::Tensor total = weight.sum().clamp_min(1e-30);
  const at::Tensor share = (weight / total).unsqueeze(1);
  const at::Tensor held = (weight == 0).to(output.scalar_type());
  at::Tensor gradient = pass.output_gradient();
  at::Tensor d_mean, state;
  const auto add = [&](int figure, const at::Tensor& value) {
    figures.select(0, figure).add_(value.sum().to(at::kDouble));
  };
  if (shape.probabilistic) {
    const at::Tensor& log_std = pass.log_std();
    const at::Tensor z = error * (-log_std).exp();
    d_mean = -z * (-log_std).exp();
    state = (log_std + 0.5 * z.square() + kHalfLog2Pi).sum(1);
    at::Tensor d_log_std = (1 - z.square()) * (share * state_scale);
    const std::int64_t bounded = shape.num_bounded;
    const double half = 0.5 * (static_cast<double>(shape.log_std_max) - shape.log_std_min);
    const at::Tensor t = (log_std.narrow(1, 0, bounded) - shape.log_std_min) / half - 1;
    d_log_std.narrow(1, 0, bounded).mul_(half * (1 - t.square()));
    gradient.narrow(1, shape.log_std_column(), n).copy_(d_log_std);
    const double part = 1.0 / static_cast<double>(n);
    add(kHeldOutLikelihood, held * state * part);
    add(kHeldOutInside50, held * (z.abs() < kHalf50).sum(1) * part);
    add(kHeldOutInside90, held * (z.abs() < kHalf90).sum(1) * part);
  } else {
    d_mean = -2 * error;
    state = error.square().sum(1);
  }
  d_mean = d_mean * (share * state_scale);
  if (shape.bound_ranges) {
    const std::int64_t ranges = shape.num_ranges;
    d_mean.narrow(1, 0, ranges).mul_(1 - mean.narrow(1, 0, ranges).square());
  }
  gradient.narrow(1, 0, n).copy_(d_mean);
  at::Tensor ended = (targets.discount == 0).to(output.scalar_type());
  at::Tensor reward = targets.reward;
  if (shape.knows_success()) {
    const at::Tensor frames = targets.next_features.narrow(1, begin, shape.frame_size());
    const at::Tensor success = ended * nn::AreSuccesses(shape, frames) * (targets.cost == 0);
    reward = reward - success * shape.goal_reward;
    ended = ended - success;
  }
  const at::Tensor reward_error = output.select(1, shape.reward_column()) - reward;
  const at::Tensor logit = output.select(1, shape.termination_column());
  const at::Tensor entropy = at::softplus(logit) - ended * logit;
  gradient.select(1, shape.reward_column()).copy_(2 * reward_error * weight / total);
  gradient.select(1, shape.termination_column()).copy_((logit.sigmoid() - ended) * weight / total);
  add(kModelStateLoss, weight * state * state_scale);
  add(kModelRewardLoss, weight * reward_error.square());
  add(kModelTerminationLoss, weight * entropy);
  add(kModelWeight, weight);
  add(kHeldOutSquares, held * error.square().mean(1));
  add(kHeldOutChange, held * (next - newest).square().mean(1));
  add(kHeldOutReward, held * reward_error.square());
  add(kHeldOutTermination, held * entropy);
  add(kHeldOutCount, held);
}

}  // namespace

void ModelLoss(const nn::ModelShape& shape, const ModelTargets& targets, double state_scale,
               nn::ModelPass& pass, at::Tensor& figures) {
  if (!nn::IsHostFloat(pass.output())) {
    return ReferenceLoss(shape, targets, state_scale, pass, figures);
  }
  const std::int64_t batch = pass.output().size(0);
  const std::int64_t num_outputs = shape.network.num_outputs();
  const std::int64_t n = shape.num_predicted;
  const std::int64_t begin = shape.network.num_inputs() - shape.frame_size();
  const double part = 1.0 / static_cast<double>(n);
  const float half = 0.5f * (shape.log_std_max - shape.log_std_min);
  double* const figure = figures.data_ptr<double>();
  const float* const weights = targets.weight.data_ptr<float>();
  double total = 0.0;
  for (std::int64_t i = 0; i < batch; ++i) total += static_cast<double>(weights[i]);
  for (std::int64_t i = 0; i < batch; ++i) {
    const float* const output = pass.output().data_ptr<float>() + i * num_outputs;
    float* const d = pass.output_gradient().data_ptr<float>() + i * num_outputs;
    const float* const newest =
        targets.features.data_ptr<float>() + i * targets.features.stride(0) + begin;
    const float* const next =
        targets.next_features.data_ptr<float>() + i * targets.next_features.stride(0) + begin;
    const bool held = weights[i] == 0.0f;
    const float share = held ? 0.0f : static_cast<float>(weights[i] / total);
    const float scale = share * static_cast<float>(state_scale);

    const double squares = Errors(shape.difference, n, newest, next, output, d);
    double state = squares;
    if (shape.probabilistic) {
      const float* const log_std = pass.log_std().data_ptr<float>() + i * n;
      float* const d_log_std = d + shape.log_std_column();
      state = LikelihoodGradient(n, log_std, d, d_log_std) + kHalfLog2Pi * static_cast<double>(n);
      if (held) {
        figure[kHeldOutLikelihood] += state * part;
        figure[kHeldOutInside50] += part * static_cast<double>(CountInside(kHalf50, n, d_log_std));
        figure[kHeldOutInside90] += part * static_cast<double>(CountInside(kHalf90, n, d_log_std));
      }
      BoundGradient(shape.log_std_min, half, shape.num_bounded, log_std, d_log_std);
      Scale(scale, n, d_log_std);
    }
    Scale(shape.probabilistic ? scale : -2.0f * scale, n, d);
    if (shape.bound_ranges) TanhGradient(shape.num_ranges, output, d);

    const bool terminated = targets.discount.data_ptr<float>()[i] == 0.0f;
    const bool success =
        terminated && targets.cost.data_ptr<float>()[i] == 0.0f && shape.IsSuccess(next);
    const float reward = targets.reward.data_ptr<float>()[i] - (success ? shape.goal_reward : 0.0f);
    const float reward_error = output[shape.reward_column()] - reward;
    const float logit = output[shape.termination_column()];
    const float ended = terminated && !success ? 1.0f : 0.0f;
    const double entropy = nn::Softplus(logit) - static_cast<double>(ended * logit);
    d[shape.reward_column()] = 2.0f * share * reward_error;
    d[shape.termination_column()] = share * (nn::SmoothSigmoid(logit) - ended);

    const double reward_square = static_cast<double>(reward_error) * reward_error;
    if (held) {
      figure[kHeldOutSquares] += squares * part;
      figure[kHeldOutChange] += ChangeSquares(n, newest, next) * part;
      figure[kHeldOutReward] += reward_square;
      figure[kHeldOutTermination] += entropy;
      figure[kHeldOutCount] += 1.0;
    } else {
      const double weight = static_cast<double>(weights[i]);
      figure[kModelStateLoss] += weight * state * state_scale;
      figure[kModelRewardLoss] += weight * reward_square;
      figure[kModelTerminationLoss] += weight * entropy;
      figure[kModelWeight] += weight;
    }
  }
}

}  // namespace slalom::learner
