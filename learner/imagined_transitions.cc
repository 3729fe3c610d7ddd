#include "learner/imagined_transitions.h"

#include <ATen/ATen.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/check.h"
#include "base/error.h"
#include "learner/stored_state.h"

namespace slalom::learner {

ImaginedTransitions::ImaginedTransitions(std::int64_t capacity, int history,
                                         const Minibatch& minibatch)
    : capacity_(capacity), frame_size_(minibatch.features.size(1) / history) {
  const auto options = minibatch.reward.options();
  try {
    features_ = at::zeros({capacity, minibatch.features.size(1)}, options);
    frames_ = at::zeros({capacity, frame_size_}, options);
    actions_ = at::zeros({capacity, minibatch.actions.size(1)}, options);
    reward_ = at::zeros({capacity}, options);
    discount_ = at::zeros({capacity}, options);
  } catch (const c10::Error&) {
    throw base::Error(fmt::format(
        "imagination.buffer_capacity is {}: cannot reserve {} MiB for imagined transitions; "
        "choose a smaller capacity",
        capacity, (capacity * (minibatch.features.size(1) + frame_size_ + 4) * 4) >> 20));
  }
}

void ImaginedTransitions::Add(const Minibatch& minibatch) {
  const std::int64_t batch = minibatch.reward.size(0);
  SLALOM_CHECK_LE(batch, capacity_);
  const at::Tensor frames =
      minibatch.next_features.narrow(1, minibatch.next_features.size(1) - frame_size_, frame_size_);
  // In two parts if they wrap around the end of the ring.
  for (std::int64_t done = 0; done < batch;) {
    const std::int64_t n = std::min(batch - done, capacity_ - next_);
    const auto copy = [&](at::Tensor& to, const at::Tensor& from) {
      to.narrow(0, next_, n).copy_(from.narrow(0, done, n));
    };
    copy(features_, minibatch.features);
    copy(frames_, frames);
    copy(actions_, minibatch.actions);
    copy(reward_, minibatch.reward);
    copy(discount_, minibatch.discount);
    done += n;
    size_ = std::min(capacity_, size_ + n);
    next_ = (next_ + n) % capacity_;
  }
}

void ImaginedTransitions::Sample(std::int64_t begin, base::Random& random,
                                 Minibatch& minibatch) const {
  SLALOM_CHECK_GT(size_, 0);
  const std::int64_t n = minibatch.reward.size(0) - begin;
  if (n == 0) return;
  at::Tensor index = at::zeros({n}, at::kLong);
  for (std::int64_t i = 0; i < n; ++i) {
    index.data_ptr<std::int64_t>()[i] =
        static_cast<std::int64_t>(random.UniformInt(static_cast<std::uint64_t>(size_)));
  }
  index = index.to(reward_.device());
  const auto rows = [&](const at::Tensor& t) { return t.narrow(0, begin, n); };
  const at::Tensor features = features_.index_select(0, index);
  const std::int64_t width = features.size(1);
  rows(minibatch.features).copy_(features);
  // The older frames of the next state are the newer ones of this state.
  rows(minibatch.next_features)
      .narrow(1, 0, width - frame_size_)
      .copy_(features.narrow(1, frame_size_, width - frame_size_));
  rows(minibatch.next_features)
      .narrow(1, width - frame_size_, frame_size_)
      .copy_(frames_.index_select(0, index));
  rows(minibatch.actions).copy_(actions_.index_select(0, index));
  rows(minibatch.reward).copy_(reward_.index_select(0, index));
  rows(minibatch.discount).copy_(discount_.index_select(0, index));
  rows(minibatch.cost).zero_();
  rows(minibatch.weight).fill_(1.0);
}

void ImaginedTransitions::SaveState(nn::TensorMap& tensors) const {
  const std::array<std::int64_t, 2> places = {size_, next_};
  tensors["imagined.places"] = nn::StoredTensor::Of(std::span<const std::int64_t>(places));
  tensors["imagined.features"] = StoreTensor(features_);
  tensors["imagined.frames"] = StoreTensor(frames_);
  tensors["imagined.actions"] = StoreTensor(actions_);
  tensors["imagined.reward"] = StoreTensor(reward_);
  tensors["imagined.discount"] = StoreTensor(discount_);
}

void ImaginedTransitions::LoadState(const nn::TensorFile& file) {
  std::array<std::int64_t, 2> places;
  file.Read("imagined.places", std::span(places));
  ReadTensor(file, "imagined.features", features_);
  ReadTensor(file, "imagined.frames", frames_);
  ReadTensor(file, "imagined.actions", actions_);
  ReadTensor(file, "imagined.reward", reward_);
  ReadTensor(file, "imagined.discount", discount_);
  size_ = std::clamp<std::int64_t>(places[0], 0, capacity_);
  next_ = std::clamp<std::int64_t>(places[1], 0, std::max<std::int64_t>(0, capacity_ - 1));
}

}  // namespace slalom::learner
