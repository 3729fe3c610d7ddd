#include "learner/critics.h"

#include <ATen/ATen.h>
#include <ATen/core/grad_mode.h>

#include <utility>

#include "base/check.h"
#include "learner/stored_state.h"

namespace slalom::learner {
Critics::Critics(std::string name, const nn::NetworkShape& shape, int num_critics,
                 base::Random& random, const Minibatch& minibatch)
    : name_(std::move(name)),
      num_critics_(num_critics),
      state_(minibatch.features),
      next_state_(minibatch.next_features),
      room_(minibatch.room),
      next_room_(minibatch.next_room),
      parameters_(InitialParameters(shape, num_critics, random, minibatch.input.device())),
      target_parameters_(parameters_.clone()),
      gradients_(MakeGradients(parameters_, minibatch)),
      gradient_(gradients_[0]),
      adam_(parameters_, gradients_, minibatch.parallel),
      networks_(shape, num_critics, parameters_, gradients_, minibatch),
      target_networks_(shape, num_critics, target_parameters_, {}, minibatch),
      pass_(shape, num_critics, minibatch.input, nn::PassUse::kTraining, minibatch),
      target_pass_(shape, num_critics, minibatch.next_input, nn::PassUse::kInference, minibatch),
      functions_(shape, parameters_, minibatch.dropout),
      target_functions_(shape, target_parameters_, minibatch.dropout) {}

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
  Step(learning_rate, polyak_rate, norm_total, 1);
}

void Critics::Step(double learning_rate, double polyak_rate, at::Tensor& norm_total,
                   int num_gradients) {
  const PolyakAverage target_networks{target_parameters_, polyak_rate};
  adam_.Step(learning_rate, std::span(&target_networks, polyak_rate > 0.0 ? 1 : 0), norm_total,
             num_gradients);
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
  target_networks_.Forward(target_pass_);
  TdTarget(target_pass_.outputs(), reduction, reward, discount, y);
}

void Critics::GradientStep(const at::Tensor& state, const at::Tensor& action, const at::Tensor& y,
                           double learning_rate, double polyak_rate, at::Tensor& loss_total,
                           at::Tensor& value_total, at::Tensor& norm_total,
                           const Importance* importance) {
  SetAction(state, action);
  if (importance != nullptr) importance->td_error.zero_();
  networks_.Forward(pass_);
  for (int k = 0; k < num_critics_; ++k) {
    const at::Tensor& q = pass_.outputs()[k];
    at::Tensor& dq = pass_.output_gradients()[k];
    SquaredError(q, y, dq, loss_total, value_total);
    if (importance != nullptr) {
      ApplyImportanceWeights(q, y, importance->weight, 1.0 / static_cast<double>(num_critics_), dq,
                             importance->td_error);
    }
  }
  networks_.ParameterGradient(pass_);
  Step(learning_rate, polyak_rate, norm_total, static_cast<int>(gradients_.size(0)));
}

at::Tensor& Critics::ActionGradient(const at::Tensor& state, const at::Tensor& action,
                                    at::Tensor* value_total) {
  SetAction(state, action);
  networks_.Forward(pass_, 1);
  const at::Tensor& q = pass_.output();
  if (value_total != nullptr) AddMean(q, *value_total);
  pass_.output_gradient().fill_(-1.0 / static_cast<double>(q.size(0)));
  networks_.ExtraGradient(pass_, 1);
  return pass_.extra_gradient();
}

at::Tensor& Critics::MinActionGradient(const at::Tensor& state, const at::Tensor& action,
                                       at::Tensor& value_total) {
  SetAction(state, action);
  networks_.Forward(pass_);
  MinGradient(pass_.outputs(), pass_.output_gradients(), value_total);
  networks_.ExtraGradient(pass_, num_critics_);
  at::Tensor& sum = pass_.extra_gradient();
  for (const at::Tensor& other : pass_.extra_gradients().subspan(1)) sum.add_(other);
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
