#include "learner/critics.h"

#include <ATen/ATen.h>

#include <utility>

#include "learner/parameters.h"
#include "learner/stored_state.h"

namespace slalom::learner {
Critics::Critics(std::string name, const nn::NetworkShape& shape, int num_critics,
                 base::Random& random, const Minibatch& minibatch)
    : name_(std::move(name)),
      parameters_(InitialParameters(shape, num_critics, random, minibatch.input.device())),
      target_parameters_(parameters_.clone()),
      gradient_(at::zeros_like(parameters_)),
      adam_(parameters_, gradient_) {
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

void Critics::ComputeTdTarget(const at::Tensor& reward, const at::Tensor& discount,
                              TargetReduction reduction, at::Tensor& y) {
  for (Critic& critic : critics_) critic.target.Forward(critic.target_pass);
  TdTarget(target_values_, reduction, reward, discount, y);
}

void Critics::GradientStep(const at::Tensor& y, double learning_rate, double polyak_rate,
                           at::Tensor& loss_total, at::Tensor& value_total, at::Tensor& norm_total,
                           const Importance* importance) {
  if (importance != nullptr) importance->td_error.zero_();
  for (Critic& critic : critics_) {
    critic.network.Forward(critic.pass);
    SquaredError(critic.pass.output(), y, critic.pass.output_gradient(), loss_total, value_total);
    if (importance != nullptr) {
      ApplyImportanceWeights(critic.pass.output(), y, importance->weight,
                             1.0 / static_cast<double>(critics_.size()),
                             critic.pass.output_gradient(), importance->td_error);
    }
    critic.network.ParameterGradient(critic.pass, critic.gradient);
  }
  const PolyakAverage target_networks{target_parameters_, polyak_rate};
  adam_.Step(learning_rate, std::span(&target_networks, polyak_rate > 0.0 ? 1 : 0), norm_total);
}

at::Tensor& Critics::ActionGradient(at::Tensor* value_total) {
  Critic& critic = critics_.front();
  critic.network.Forward(critic.pass);
  if (value_total != nullptr) AddMean(critic.pass.output(), *value_total);
  critic.pass.output_gradient().fill_(-1.0 / static_cast<double>(critic.pass.output().size(0)));
  critic.network.ExtraGradient(critic.pass);
  return critic.pass.extra_gradient();
}

at::Tensor& Critics::MinActionGradient(at::Tensor& value_total) {
  for (Critic& critic : critics_) critic.network.Forward(critic.pass);
  MinGradient(values_, value_gradients_, value_total);
  at::Tensor& sum = critics_.front().pass.extra_gradient();
  for (Critic& critic : critics_) {
    critic.network.ExtraGradient(critic.pass);
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
