#include "learner/deterministic_actor.h"

#include <ATen/ATen.h>
#include <ATen/core/grad_mode.h>

#include <array>

#include "base/check.h"
#include "learner/stored_state.h"
#include "learner/value_ops.h"
#include "policy/nn/kernels/layer_ops.h"

namespace slalom::learner {
DeterministicActor::DeterministicActor(const nn::NetworkShape& shape,
                                       const policy::ActionDistribution& /*distribution*/,
                                       base::Random& random, const Minibatch& minibatch)
    : state_(minibatch.features),
      next_state_(minibatch.next_features),
      parameters_(InitialParameters(shape, 1, random, minibatch.input.device())),
      target_parameters_(parameters_.clone()),
      average_parameters_(parameters_.clone()),
      gradients_(MakeGradients(parameters_, minibatch)),
      gradient_(gradients_[0]),
      adam_(parameters_, gradients_, minibatch.parallel),
      network_(shape, 1, parameters_, gradients_, minibatch),
      target_(shape, 1, target_parameters_, {}, minibatch),
      pass_(shape, 1, minibatch.features, nn::PassUse::kTraining, minibatch),
      target_pass_(shape, 1, minibatch.next_features, nn::PassUse::kInference, minibatch),
      preactivation_(at::zeros_like(pass_.output())),
      functions_(shape, parameters_, minibatch.dropout),
      target_functions_(shape, target_parameters_, minibatch.dropout) {}

at::Tensor DeterministicActor::Actions(const at::Tensor& state) const {
  return functions_(state).squeeze(1).tanh();
}

at::Tensor DeterministicActor::TargetActions(const at::Tensor& state) const {
  const at::NoGradGuard no_grad;
  return target_functions_(state).squeeze(1).tanh();
}

void DeterministicActor::Descend(const at::Tensor& loss, double learning_rate, double polyak_rate,
                                 double average_rate, at::Tensor& norm_total) {
  functions_.Differentiate(loss, gradient_);
  Step(learning_rate, polyak_rate, average_rate, norm_total, 1);
}

const at::Tensor& DeterministicActor::Act(const at::Tensor& state) {
  SLALOM_CHECK(state.is_same(state_));
  network_.Forward(pass_);
  preactivation_.copy_(pass_.output());
  nn::Tanh(pass_.output());
  return pass_.output();
}

const at::Tensor& DeterministicActor::ActTarget(const at::Tensor& next_state) {
  SLALOM_CHECK(next_state.is_same(next_state_));
  target_.Forward(target_pass_);
  nn::Tanh(target_pass_.output());
  return target_pass_.output();
}

void DeterministicActor::PolicyGradientStep(const at::Tensor& action_gradient,
                                            double preactivation_penalty, double learning_rate,
                                            double polyak_rate, double average_rate,
                                            at::Tensor& norm_total) {
  CopyActions(action_gradient, pass_.output_gradient());
  nn::TanhGradient(pass_.output(), pass_.output_gradient());
  if (preactivation_penalty > 0.0) {
    pass_.output_gradient().add_(
        preactivation_, 2.0 * preactivation_penalty / static_cast<double>(preactivation_.size(0)));
  }
  network_.ParameterGradient(pass_);
  Step(learning_rate, polyak_rate, average_rate, norm_total, static_cast<int>(gradients_.size(0)));
}

void DeterministicActor::Step(double learning_rate, double polyak_rate, double average_rate,
                              at::Tensor& norm_total, int num_gradients) {
  const std::array averages = {PolyakAverage{target_parameters_, polyak_rate},
                               PolyakAverage{average_parameters_, average_rate}};
  adam_.Step(learning_rate, std::span(averages).first(average_rate > 0.0 ? 2 : 1), norm_total,
             num_gradients);
}

void DeterministicActor::StartFrom(const at::Tensor& parameters) {
  for (at::Tensor* own : {&parameters_, &target_parameters_, &average_parameters_}) {
    own->copy_(parameters);
  }
}

void DeterministicActor::SaveState(nn::TensorMap& tensors) const {
  tensors["actor.parameters"] = StoreTensor(parameters_);
  tensors["actor.target_parameters"] = StoreTensor(target_parameters_);
  tensors["actor.average_parameters"] = StoreTensor(average_parameters_);
  adam_.SaveState("actor.adam", tensors);
}

void DeterministicActor::LoadState(const nn::TensorFile& file) {
  ReadTensor(file, "actor.parameters", parameters_);
  ReadTensor(file, "actor.target_parameters", target_parameters_);
  ReadTensor(file, "actor.average_parameters", average_parameters_);
  adam_.LoadState("actor.adam", file);
}

}  // namespace slalom::learner
