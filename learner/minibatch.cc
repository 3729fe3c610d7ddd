#include "learner/minibatch.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "base/check.h"

namespace slalom::learner {
namespace {

/// How many scans are prefetched ahead of the one being read.
constexpr std::size_t kPrefetchDistance = 3;

/// Samples that a thread reads at a time.
constexpr int kReadTogether = 16;

/// Slices of a minibatch that threads share. Each costs another pass over the weights and another
/// gradient, so that more of them are slower on two cores (docs/results/methods.md).
constexpr std::int64_t kNumSlices = 2;

/// Rows that the kernels multiply together: a slice has a multiple of them, but for the last.
constexpr std::int64_t kSliceStep = 8;

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

std::vector<RowSlice> Minibatch::Slices() const {
  const std::int64_t batch = input.size(0);
  if (parallel == nullptr) return {{0, batch}};
  const std::int64_t most = (batch + kNumSlices - 1) / kNumSlices;
  const std::int64_t size = (most + kSliceStep - 1) / kSliceStep * kSliceStep;
  std::vector<RowSlice> slices;
  for (std::int64_t begin = 0; begin < batch; begin += size) {
    slices.push_back({begin, std::min(size, batch - begin)});
  }
  return slices;
}

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
  mirrored_.assign(static_cast<std::size_t>(rows.batch), false);
  if (mirror_) {
    for (char& mirrored : mirrored_) mirrored = (random.NextU64() >> 63) != 0;
  }
  const int num_slices = (rows.batch + kReadTogether - 1) / kReadTogether;
  base::For(minibatch.parallel, num_slices, [&](int i) {
    const int begin = i * kReadTogether;
    ReadSlice(rows, {begin, std::min(kReadTogether, rows.batch - begin)}, host);
  });
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

void MinibatchReader::ReadSlice(const replay::SampledRows& rows, const RowSlice& slice,
                                Minibatch& host) const {
  const auto state_size = static_cast<std::size_t>(rows.shape.state_size);
  const auto action_size = static_cast<std::size_t>(rows.shape.action_size);
  const std::size_t frame = static_cast<std::size_t>(features_.frame_size());
  const std::size_t stride = static_cast<std::size_t>(host.input.stride(0));
  float* const input = host.input.data_ptr<float>();
  float* const next_input = host.next_input.data_ptr<float>();
  float* const actions = host.actions.data_ptr<float>();
  const std::size_t history = static_cast<std::size_t>(history_);
  const std::size_t num_frames = static_cast<std::size_t>(rows.batch) * history;
  const std::size_t begin = static_cast<std::size_t>(slice.begin);
  const std::size_t end = begin + static_cast<std::size_t>(slice.size);
  for (std::size_t sample = begin; sample < end; ++sample) {
    const bool mirrored = mirrored_[sample] != 0;
    float* const action = actions + sample * action_size;
    std::copy_n(&rows.action[sample * action_size], action_size, action);
    if (mirrored) action[1] = -action[1];  // The turn.
    host.reward.data_ptr<float>()[sample] = reward_scale_ * rows.n_step_return[sample];
    host.cost.data_ptr<float>()[sample] = rows.cost_return[sample];
    host.discount.data_ptr<float>()[sample] = discount_factor_ * rows.discount[sample];
    host.weight.data_ptr<float>()[sample] = rows.weight[sample];
    for (std::size_t age = 0; age < history; ++age) {
      const std::size_t i = sample * history + age;
      if (i + kPrefetchDistance < num_frames) {
        features_.Prefetch(rows.ranges_cm[i + kPrefetchDistance]);
        features_.Prefetch(rows.next_ranges_cm[i + kPrefetchDistance]);
      }
      const std::size_t place = sample * stride + age * frame;
      features_.Write(rows.ranges_cm[i], rows.state.data() + i * state_size, mirrored,
                      input + place);
      features_.Write(rows.next_ranges_cm[i], rows.next_state.data() + i * state_size, mirrored,
                      next_input + place);
    }
  }
}

}  // namespace slalom::learner
