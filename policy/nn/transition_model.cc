#include "policy/nn/transition_model.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cstring>

#include "base/check.h"
#include "base/vector_clones.h"
#include "env/action.h"
#include "policy/nn/kernels/layer_ops.h"
#include "policy/nn/kernels/smooth_math.h"

namespace slalom::nn {
namespace {

/// next = newest + mean, or mean, of one row.
SLALOM_SIMD void AddMean(bool difference, std::int64_t n, const float* __restrict mean,
                         float* __restrict newest) {
  if (difference) {
    for (std::int64_t j = 0; j < n; ++j) newest[j] += mean[j];
  } else {
    for (std::int64_t j = 0; j < n; ++j) newest[j] = mean[j];
  }
}

SLALOM_SIMD void AddNoise(std::int64_t n, const float* __restrict log_std,
                          const float* __restrict noise, float* __restrict next) {
  for (std::int64_t j = 0; j < n; ++j) next[j] += SmoothExp(log_std[j]) * noise[j];
}

SLALOM_SIMD void BoundLogStd(float low, float high, std::int64_t n, const float* __restrict raw,
                             float* __restrict log_std) {
  const float half = 0.5f * (high - low);
  for (std::int64_t j = 0; j < n; ++j) log_std[j] = low + half * (1.0f + SmoothTanh(raw[j]));
}

SLALOM_SIMD void TanhInPlace(std::int64_t n, float* __restrict values) {
  for (std::int64_t j = 0; j < n; ++j) values[j] = SmoothTanh(values[j]);
}

SLALOM_SIMD void Clip(float low, float high, std::int64_t n, float* __restrict values) {
  for (std::int64_t j = 0; j < n; ++j) {
    const float above = values[j] < low ? low : values[j];
    values[j] = above > high ? high : above;
  }
}

}  // namespace

at::Tensor AreSuccesses(const ModelShape& shape, const at::Tensor& frames) {
  const at::Tensor x = frames.select(1, shape.num_ranges) + shape.goal_x_offset;
  const at::Tensor y = frames.select(1, shape.num_ranges + 1) + shape.goal_y_offset;
  return (x.square() + y.square() < shape.squared_goal_radius).to(frames.scalar_type());
}

ModelPass::ModelPass(const ModelShape& shape, const at::Tensor& input, PassUse use)
    : input_(input), network_(shape.network, input, use) {
  const std::int64_t batch = input.size(0);
  if (shape.probabilistic) log_std_ = at::zeros({batch, shape.num_predicted}, input.options());
  reward_ = at::zeros({batch}, input.options());
  termination_ = at::zeros({batch}, input.options());
}

TransitionModel::TransitionModel(const ModelShape& shape, const at::Tensor& parameters)
    : shape_(shape) {
  SLALOM_CHECK_EQ(parameters.numel(), shape.num_parameters());
  const std::int64_t size = shape.num_member_parameters();
  for (int i = 0; i < shape.ensemble; ++i) {
    members_.emplace_back(shape.network, parameters.narrow(0, i * size, size));
  }
}

void TransitionModel::Forward(ModelPass& pass, int member) const {
  SLALOM_CHECK(member >= 0 && member < shape_.ensemble);
  members_[member].Forward(pass.network_);
  at::Tensor& output = pass.output();
  const std::int64_t learned = shape_.num_predicted;
  if (!IsHostFloat(output)) {
    if (shape_.bound_ranges) output.narrow(1, 0, shape_.num_ranges).tanh_();
    if (!shape_.probabilistic) return;
    const double low = shape_.log_std_min;
    const double half = 0.5 * (static_cast<double>(shape_.log_std_max) - low);
    pass.log_std_.copy_(output.narrow(1, shape_.log_std_column(), learned));
    pass.log_std_.narrow(1, 0, shape_.num_bounded).tanh_().add_(1.0).mul_(half).add_(low);
    return;
  }
  const std::int64_t num_outputs = shape_.network.num_outputs();
  for (std::int64_t i = 0; i < output.size(0); ++i) {
    float* const row = output.data_ptr<float>() + i * num_outputs;
    if (shape_.bound_ranges) TanhInPlace(shape_.num_ranges, row);
    if (!shape_.probabilistic) continue;
    const float* const raw = row + shape_.log_std_column();
    float* const log_std = pass.log_std_.data_ptr<float>() + i * learned;
    BoundLogStd(shape_.log_std_min, shape_.log_std_max, shape_.num_bounded, raw, log_std);
    std::copy(raw + shape_.num_bounded, raw + learned, log_std + shape_.num_bounded);
  }
}

void TransitionModel::Predict(ModelPass& pass, int member, const at::Tensor& noise,
                              at::Tensor& next) const {
  Forward(pass, member);
  const bool noisy = shape_.probabilistic && noise.defined();
  const std::int64_t frame = shape_.frame_size();
  const std::int64_t width = shape_.network.num_inputs();
  const std::int64_t learned = shape_.num_predicted;
  SLALOM_CHECK_EQ(next.size(1), width);

  if (!IsHostFloat(next)) {
    const at::Tensor newest = pass.input_.narrow(1, width - frame, frame);
    at::Tensor predicted = pass.output().narrow(1, 0, learned);
    if (shape_.difference) predicted = predicted + newest.narrow(1, 0, learned);
    if (noisy) predicted = predicted + pass.log_std_.exp() * noise;
    at::Tensor ranges = predicted.narrow(1, 0, shape_.num_ranges);
    if (!shape_.bound_ranges) ranges = ranges.clamp(shape_.range_low, shape_.range_high);
    const at::Tensor actions = pass.input_.narrow(1, width, env::kActionSize).clamp(-1.0, 1.0);
    at::Tensor stack = at::cat({pass.input_.narrow(1, frame, width - frame), ranges,
                                predicted.narrow(1, shape_.num_ranges, learned - shape_.num_ranges),
                                actions.narrow(1, 0, frame - learned)},
                               1);
    next.copy_(stack);
    pass.reward_.copy_(pass.output().select(1, shape_.reward_column()));
    pass.termination_.copy_(pass.output().select(1, shape_.termination_column()).sigmoid());
    if (shape_.knows_success()) {
      const at::Tensor success = AreSuccesses(shape_, next.narrow(1, width - frame, frame));
      pass.reward_.add_(success, shape_.goal_reward);
      pass.termination_.copy_(at::max(pass.termination_, success));
    }
    return;
  }

  const std::int64_t batch = next.size(0);
  const std::int64_t num_outputs = shape_.network.num_outputs();
  const float* const input = pass.input_.data_ptr<float>();
  const float* const output = pass.output().data_ptr<float>();
  for (std::int64_t i = 0; i < batch; ++i) {
    const float* const from = input + i * pass.input_.stride(0);
    const float* const result = output + i * num_outputs;
    float* const to = next.data_ptr<float>() + i * next.stride(0);
    float* const newest = to + width - frame;
    const float action[env::kActionSize] = {std::clamp(from[width], -1.0f, 1.0f),
                                            std::clamp(from[width + 1], -1.0f, 1.0f)};
    // The older frames move up; in their own place, too, as nothing there is written before it is
    // read. The newest stays for a moment, for the prediction is often a change of it.
    std::memmove(to, from + frame, static_cast<std::size_t>(width - frame) * sizeof(float));
    if (to != from) std::copy(from + width - frame, from + width, newest);
    AddMean(shape_.difference, learned, result, newest);
    if (noisy) {
      AddNoise(learned, pass.log_std_.data_ptr<float>() + i * learned,
               noise.data_ptr<float>() + i * learned, newest);
    }
    if (!shape_.bound_ranges) Clip(shape_.range_low, shape_.range_high, shape_.num_ranges, newest);
    std::copy(action, action + (frame - learned), newest + learned);
    const bool success = shape_.IsSuccess(newest);
    pass.reward_.data_ptr<float>()[i] =
        result[shape_.reward_column()] + (success ? shape_.goal_reward : 0.0f);
    pass.termination_.data_ptr<float>()[i] =
        success ? 1.0f : SmoothSigmoid(result[shape_.termination_column()]);
  }
}

}  // namespace slalom::nn
