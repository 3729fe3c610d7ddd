#include "learner/minibatch.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "base/check.h"

namespace slalom::learner {
namespace {

/// How many scans are prefetched ahead of the one being read.
constexpr std::size_t kPrefetchDistance = 3;

}  // namespace

Minibatch::Minibatch(int batch, int history, int frame_size, at::Device device, int action_size) {
  const auto options = at::TensorOptions(at::kFloat).device(device);
  const std::int64_t width = static_cast<std::int64_t>(history) * frame_size;
  input = at::zeros({batch, width + action_size}, options);
  next_input = at::zeros({batch, width + action_size}, options);
  features = input.narrow(1, 0, width);
  next_features = next_input.narrow(1, 0, width);
  room = input.narrow(1, width, action_size);
  next_room = next_input.narrow(1, width, action_size);
  actions = at::zeros({batch, action_size}, options);
  reward = at::zeros({batch}, options);
  cost = at::zeros({batch}, options);
  discount = at::zeros({batch}, options);
  weight = at::ones({batch}, options);
}

MinibatchReader::MinibatchReader(nn::FeatureMap features, int history, double reward_scale,
                                 bool mirror, double discount_factor)
    : features_(std::move(features)),
      history_(history),
      reward_scale_(static_cast<float>(reward_scale)),
      mirror_(mirror),
      discount_factor_(static_cast<float>(discount_factor)) {}

void MinibatchReader::Read(const replay::SampledRows& rows, base::Random& random,
                           Minibatch& minibatch) {
  const bool on_host = minibatch.input.device().is_cpu();
  if (!on_host && !host_) {
    host_ = std::make_unique<Minibatch>(rows.batch, history_, features_.frame_size(), at::kCPU,
                                        rows.shape.action_size);
  }
  Minibatch& host = on_host ? minibatch : *host_;
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(rows.batch), host.input.size(0));
  SLALOM_CHECK_EQ(rows.history, history_);
  SLALOM_CHECK_EQ(rows.shape.num_beams, features_.num_beams());
  SLALOM_CHECK_EQ(static_cast<std::int64_t>(rows.shape.action_size), host.actions.size(1));
  const auto state_size = static_cast<std::size_t>(rows.shape.state_size);
  const auto action_size = static_cast<std::size_t>(rows.shape.action_size);
  const std::size_t frame = static_cast<std::size_t>(features_.frame_size());
  const std::size_t stride = static_cast<std::size_t>(host.input.stride(0));
  float* const input = host.input.data_ptr<float>();
  float* const next_input = host.next_input.data_ptr<float>();
  float* const actions = host.actions.data_ptr<float>();
  float* const reward = host.reward.data_ptr<float>();
  float* const discount = host.discount.data_ptr<float>();
  std::copy_n(rows.cost_return.data(), rows.batch, host.cost.data_ptr<float>());
  std::copy_n(rows.weight.data(), rows.batch, host.weight.data_ptr<float>());
  const std::size_t history = static_cast<std::size_t>(history_);
  const std::size_t num_frames = static_cast<std::size_t>(rows.batch) * history;
  bool mirrored = false;
  for (std::size_t i = 0; i < num_frames; ++i) {
    if (i + kPrefetchDistance < num_frames) {
      features_.Prefetch(rows.ranges_cm[i + kPrefetchDistance]);
      features_.Prefetch(rows.next_ranges_cm[i + kPrefetchDistance]);
    }
    const std::size_t sample = i / history;
    const std::size_t age = i % history;
    float* const row = input + sample * stride;
    if (age == 0) {
      mirrored = mirror_ && (random.NextU64() >> 63) != 0;
      float* const action = actions + sample * action_size;
      std::copy_n(&rows.action[sample * action_size], action_size, action);
      if (mirrored) action[1] = -action[1];  // The turn.
      reward[sample] = reward_scale_ * rows.n_step_return[sample];
      discount[sample] = discount_factor_ * rows.discount[sample];
    }
    features_.Write(rows.ranges_cm[i], rows.state.data() + i * state_size, mirrored,
                    row + age * frame);
    features_.Write(rows.next_ranges_cm[i], rows.next_state.data() + i * state_size, mirrored,
                    next_input + sample * stride + age * frame);
  }
  if (!on_host) {
    minibatch.input.copy_(host.input);
    minibatch.next_input.copy_(host.next_input);
    minibatch.actions.copy_(host.actions);
    minibatch.reward.copy_(host.reward);
    minibatch.cost.copy_(host.cost);
    minibatch.discount.copy_(host.discount);
    minibatch.weight.copy_(host.weight);
  }
}

}  // namespace slalom::learner
