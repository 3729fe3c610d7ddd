#include "learner/critics.h"

#include <ATen/ATen.h>
#include <ATen/core/grad_mode.h>

#include <utility>

#include "base/check.h"
#include "learner/stored_state.h"
#include "policy/nn/network.h"

namespace slalom::learner {
Critics::Critics(std::string name, const nn::NetworkShape& shape, int num_critics,
                 base::Random& random, const Minibatch& minibatch)
    : name_(std::move(name)),
      parallel_(minibatch.parallel),
      state_(minibatch.features),
      next_state_(minibatch.next_features),
      room_(minibatch.room),
      next_room_(minibatch.next_room),
      parameters_(InitialParameters(shape, num_critics, random, minibatch.input.device())),
      target_parameters_(parameters_.clone()),
      gradient_(at::zeros_like(parameters_)),
      adam_(parameters_, gradient_),
      functions_(shape, parameters_, minibatch.dropout),
      target_functions_(shape, target_parameters_, minibatch.dropout) {
  const std::int64_t size = shape.num_parameters();
  for (int k = 0; k < num_critics; ++k) {
    critics_.push_back(
        {nn::Network(shape, parameters_.narrow(0, k * size, size)),
         nn::Network(shape, target_parameters_.narrow(0, k * size, size)),
         nn::Network(shape, gradient_.narrow(0, k * size, size)),
         nn::NetworkPass(shape, minibatch.input, nn::PassUse::kTraining, minibatch.dropout),
         nn::NetworkPass(shape, minibatch.next_input, nn::PassUse::kInference, minibatch.dropout)});
    target_values_.push_back(critics_.back().target_pass.output());
    values_.push_back(critics_.back().pass.output());
    value_gradients_.push_back(critics_.back().pass.output_gradient());
  }
}

at::Tensor Critics::Values(const at::Tensor& state, const at::Tensor& action) const {
  return functions_(state, action);
}

at::Tensor Critics::TargetValues(const at::Tensor& state, const at::Tensor& action) const {
  const at::NoGradGuard no_grad;
  return target_functions_(state, action);
}

void Critics::Descend(const at::Tensor& loss, double learning_rate, double polyak_rate,
                      at::Tensor& norm_total) {
  functions_.Differentiate(loss, gradient_);
  Step(learning_rate, polyak_rate, norm_total);
}

void Critics::Step(double learning_rate, double polyak_rate, at::Tensor& norm_total) {
  const PolyakAverage target_networks{target_parameters_, polyak_rate};
  adam_.Step(learning_rate, std::span(&target_networks, polyak_rate > 0.0 ? 1 : 0), norm_total);
}

void Critics::ForEach(const std::function<void(int k)>& body) {
  if (parallel_ != nullptr) return parallel_->For(size(), body);
  for (int k = 0; k < size(); ++k) body(k);
}

void Critics::SetAction(const at::Tensor& state, const at::Tensor& action) {
  SLALOM_CHECK(state.is_same(state_));
  CopyActions(action, room_);
}

void Critics::ComputeTdTarget(const at::Tensor& next_state, const at::Tensor& next_action,
                              const at::Tensor& reward, const at::Tensor& discount,
                              TargetReduction reduction, at::Tensor& y) {
  SLALOM_CHECK(next_state.is_same(next_state_));
  CopyActions(next_action, next_room_);
  ForEach([this](int k) { critics_[k].target.Forward(critics_[k].target_pass); });
  TdTarget(target_values_, reduction, reward, discount, y);
}

void Critics::GradientStep(const at::Tensor& state, const at::Tensor& action, const at::Tensor& y,
                           double learning_rate, double polyak_rate, at::Tensor& loss_total,
                           at::Tensor& value_total, at::Tensor& norm_total,
                           const Importance* importance) {
  SetAction(state, action);
  if (importance != nullptr) importance->td_error.zero_();
  ForEach([this](int k) { critics_[k].network.Forward(critics_[k].pass); });
  for (Critic& critic : critics_) {
    SquaredError(critic.pass.output(), y, critic.pass.output_gradient(), loss_total, value_total);
    if (importance != nullptr) {
      ApplyImportanceWeights(critic.pass.output(), y, importance->weight,
                             1.0 / static_cast<double>(critics_.size()),
                             critic.pass.output_gradient(), importance->td_error);
    }
  }
  ForEach([this](int k) {
    critics_[k].network.ParameterGradient(critics_[k].pass, critics_[k].gradient);
  });
  Step(learning_rate, polyak_rate, norm_total);
}

at::Tensor& Critics::ActionGradient(const at::Tensor& state, const at::Tensor& action,
                                    at::Tensor* value_total) {
  SetAction(state, action);
  Critic& critic = critics_.front();
  critic.network.Forward(critic.pass);
  if (value_total != nullptr) AddMean(critic.pass.output(), *value_total);
  critic.pass.output_gradient().fill_(-1.0 / static_cast<double>(critic.pass.output().size(0)));
  critic.network.ExtraGradient(critic.pass);
  return critic.pass.extra_gradient();
}

at::Tensor& Critics::MinActionGradient(const at::Tensor& state, const at::Tensor& action,
                                       at::Tensor& value_total) {
  SetAction(state, action);
  ForEach([this](int k) { critics_[k].network.Forward(critics_[k].pass); });
  MinGradient(values_, value_gradients_, value_total);
  ForEach([this](int k) { critics_[k].network.ExtraGradient(critics_[k].pass); });
  at::Tensor& sum = critics_.front().pass.extra_gradient();
  for (Critic& critic : critics_) {
    if (&critic != &critics_.front()) sum.add_(critic.pass.extra_gradient());
  }
  return sum;
}

void Critics::SaveState(nn::TensorMap& tensors) const {
  tensors[name_ + ".parameters"] = StoreTensor(parameters_);
  tensors[name_ + ".target_parameters"] = StoreTensor(target_parameters_);
  adam_.SaveState(name_ + ".adam", tensors);
}

void Critics::LoadState(const nn::TensorFile& file) {
  ReadTensor(file, name_ + ".parameters", parameters_);
  ReadTensor(file, name_ + ".target_parameters", target_parameters_);
  adam_.LoadState(name_ + ".adam", file);
}

}  // namespace slalom::learner
