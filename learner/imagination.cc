#include "learner/imagination.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/check.h"
#include "base/error.h"
#include "learner/stored_state.h"
#include "learner/value_ops.h"

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
    throw base::Error(
        "imagination.buffer_capacity is {}: cannot reserve {} MiB for imagined transitions; choose "
        "a smaller capacity",
        capacity, (capacity * (minibatch.features.size(1) + frame_size_ + 4) * 4) >> 20);
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

namespace {

/// Views of all tensors that make up the transitions of a minibatch.
std::array<at::Tensor, 7> Columns(const Minibatch& m) {
  return {m.features, m.actions, m.next_features, m.reward, m.cost, m.discount, m.weight};
}

}  // namespace

int RolloutSteps(const ImaginationConfig& config, std::int64_t num_updates) {
  if (config.final_rollout_steps == 0) return config.rollout_steps;
  const auto span = static_cast<double>(config.schedule_end - config.schedule_begin);
  const auto passed = static_cast<double>(num_updates - config.schedule_begin);
  const double share =
      span > 0.0 ? std::clamp(passed / span, 0.0, 1.0) : (passed >= 0.0 ? 1.0 : 0.0);
  const int growth = config.final_rollout_steps - config.rollout_steps;
  return config.rollout_steps + static_cast<int>(std::floor(share * growth));
}

Imagination::Imagination(const ImaginationConfig& config, double gamma, const ModelTrainer& trainer,
                         Algorithm& algorithm, Minibatch& minibatch, std::uint64_t seed)
    : config_(config),
      gamma_(gamma),
      trainer_(trainer),
      algorithm_(algorithm),
      minibatch_(minibatch),
      random_(base::DeriveSeed(seed, "imagination")),
      pass_(trainer.model().shape(), minibatch.next_input),
      action_noise_(minibatch.reward.size(0), env::kActionSize, minibatch.reward.device()),
      model_noise_(minibatch.reward.size(0), trainer.model().shape().num_predicted,
                   minibatch.reward.device()),
      alive_(at::ones_like(minibatch.reward)),
      real_(static_cast<int>(minibatch.reward.size(0)), trainer.model().shape().history(),
            trainer.model().shape().frame_size(), minibatch.reward.device()),
      transitions_(config.kind == ImaginationKind::kMbpo ? config.buffer_capacity : 0,
                   trainer.model().shape().history(), minibatch) {
  SLALOM_CHECK_GE(trainer.loaded().reward.size(0),
                  NumStartingStates(config, static_cast<int>(minibatch.reward.size(0))));
}

/// Janner et al. 2019, algorithm 2, line 6: for M model rollouts do.
void Imagination::Begin(std::int64_t num_updates) {
  if (config_.kind != ImaginationKind::kMbpo) return;
  const auto kept = Columns(real_), replayed = Columns(minibatch_);
  for (std::size_t c = 0; c < kept.size(); ++c) kept[c].copy_(replayed[c]);
  const int steps = RolloutSteps(config_, num_updates);
  const std::int64_t batch = minibatch_.reward.size(0);
  for (std::int64_t row = 0; row < config_.rollouts; row += batch) RollOut(row, steps);
}

void Imagination::Fill(int k) {
  if (config_.kind == ImaginationKind::kDyna) {
    if (config_.as_published) return FillAsPublished(k);
    return FillDyna(k);
  }
  // Janner et al. 2019, algorithm 2, line 10: the data that the policy is updated on. Replayed
  // transitions come first, different ones in each batch, then imagined ones.
  const std::int64_t batch = minibatch_.reward.size(0);
  const std::int64_t num_real = NumReal(config_, batch);
  const auto to = Columns(minibatch_), from = Columns(real_);
  // Copies runs of rows, wrapping around at the end of the batch.
  for (std::int64_t done = 0; done < num_real;) {
    const std::int64_t row = (k * num_real + done) % batch;
    const std::int64_t n = std::min(num_real - done, batch - row);
    for (std::size_t c = 0; c < to.size(); ++c) {
      to[c].narrow(0, done, n).copy_(from[c].narrow(0, row, n));
    }
    done += n;
  }
  transitions_.Sample(num_real, random_, minibatch_);
}

/// Line 7: sample s_t from the replay. Sets the minibatch's state, and the state that is rolled
/// forward, to `loaded` rows from `row` on.
void Imagination::StartFrom(std::int64_t row) {
  const std::int64_t batch = minibatch_.reward.size(0);
  minibatch_.features.copy_(trainer_.loaded().features.narrow(0, row, batch));
  minibatch_.next_features.copy_(minibatch_.features);
  minibatch_.cost.zero_();
  minibatch_.weight.fill_(1.0);
}

/// Does one model step in place, from minibatch.next_features to the predicted next state. The
/// policy's action with noise is left in minibatch.next_room, where the model reads it.
void Imagination::Step(bool clip) {
  const at::Tensor noise = action_noise_.Draw(random_).mul_(config_.noise);
  if (clip) {
    AddClippedNoise(algorithm_.ActNext(), noise, minibatch_.next_room);
  } else {
    minibatch_.next_room.copy_(algorithm_.ActNext()).add_(noise);
  }
  const auto elites = trainer_.elites();
  const int member = elites[random_.UniformInt(elites.size())];
  const bool noisy = trainer_.model().shape().probabilistic;
  trainer_.model().Predict(pass_, member, noisy ? model_noise_.Draw(random_) : at::Tensor(),
                           minibatch_.next_features);
  num_transitions_ += minibatch_.reward.size(0);
}

/// The n-step transition of docs/models.md: r = sum_i gamma^i alive_i r_i, then gamma^n alive_n.
/// Dyna (Sutton 1990) with n = 1; n steps: docs/original-system.md, section 5.2.
void Imagination::FillDyna(int k) {
  StartFrom(k * minibatch_.reward.size(0));
  minibatch_.reward.zero_();
  alive_.fill_(1.0);
  double discount = 1.0;
  for (int i = 0; i < config_.rollout_steps; ++i) {
    Step(/*clip=*/true);
    if (i == 0) minibatch_.actions.copy_(minibatch_.next_room);
    minibatch_.reward.addcmul_(alive_, pass_.reward(), discount);
    alive_.addcmul_(alive_, pass_.termination(), -1.0);
    discount *= gamma_;
  }
  minibatch_.discount.copy_(alive_).mul_(discount);
}

/// docs/original-system.md, section 5.3, M3: every step starts from the same state.
void Imagination::FillAsPublished(int k) {
  StartFrom(k * minibatch_.reward.size(0));
  alive_.fill_(1.0);
  minibatch_.discount.fill_(1.0);
  for (int i = 0; i < config_.rollout_steps; ++i) {
    minibatch_.next_features.copy_(minibatch_.features);
    Step(/*clip=*/false);
    if (i == 0) minibatch_.actions.copy_(minibatch_.next_room);
    alive_.addcmul_(alive_, pass_.termination(), -1.0);
    minibatch_.discount.mul_(at::pow(gamma_, alive_));
  }
  minibatch_.reward.copy_(pass_.reward());
  minibatch_.discount.mul_(alive_);
}

/// Line 8: a rollout of k = `steps` steps by the policy, added to D_model. A network is drawn
/// for each step, as in section 5 there.
void Imagination::RollOut(std::int64_t row, int steps) {
  StartFrom(row);
  at::Tensor uniform = at::zeros({minibatch_.reward.size(0)}, at::kFloat);
  for (int i = 0; i < steps; ++i) {
    minibatch_.features.copy_(minibatch_.next_features);
    Step(/*clip=*/true);
    minibatch_.actions.copy_(minibatch_.next_room);
    minibatch_.reward.copy_(pass_.reward());
    for (std::int64_t j = 0; j < uniform.numel(); ++j) {
      uniform.data_ptr<float>()[j] = static_cast<float>(random_.Uniform());
    }
    const at::Tensor ended = uniform.to(alive_.device()) < pass_.termination();
    minibatch_.discount.fill_(gamma_).masked_fill_(ended, 0.0);
    transitions_.Add(minibatch_);
    // A rollout that ended starts again. This works on every device without waiting for it.
    const std::int64_t batch = minibatch_.reward.size(0);
    minibatch_.next_features.copy_(at::where(ended.unsqueeze(1),
                                             trainer_.loaded().features.narrow(0, row, batch),
                                             minibatch_.next_features));
  }
}

void Imagination::SaveState(nn::TensorMap& tensors) const {
  tensors["imagination.random"] = StoreRandom(random_);
  tensors["imagination.transitions"] =
      nn::StoredTensor::Of(std::span<const std::int64_t>(&num_transitions_, 1));
  if (config_.kind == ImaginationKind::kMbpo) transitions_.SaveState(tensors);
}

void Imagination::LoadState(const nn::TensorFile& file) {
  ReadRandom(file, "imagination.random", random_);
  file.Read("imagination.transitions", std::span(&num_transitions_, 1));
  if (config_.kind == ImaginationKind::kMbpo) transitions_.LoadState(file);
}

}  // namespace slalom::learner
