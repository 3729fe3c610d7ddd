#include "learner/gaussian_actor.h"

#include <ATen/ATen.h>

#include <span>

#include "base/check.h"
#include "learner/stored_state.h"
#include "learner/value_ops.h"
#include "policy/nn/kernels/layer_ops.h"

namespace slalom::learner {

GaussianActor::GaussianActor(const nn::NetworkShape& shape,
                             const policy::ActionDistribution& distribution, base::Random& random,
                             const Minibatch& minibatch)
    : distribution_(distribution),
      state_(minibatch.features),
      next_state_(minibatch.next_features),
      parameters_(InitialParameters(shape, 1, random, minibatch.input.device())),
      average_parameters_(parameters_.clone()),
      gradients_(MakeGradients(parameters_, minibatch)),
      gradient_(gradients_[0]),
      adam_(parameters_, gradients_, minibatch.parallel),
      network_(shape, 1, parameters_, gradients_, minibatch),
      now_{SlicedNetworks::Pass(shape, 1, minibatch.features, nn::PassUse::kTraining, minibatch),
           at::zeros_like(minibatch.actions), at::zeros_like(minibatch.reward)},
      next_{SlicedNetworks::Pass(shape, 1, minibatch.next_features, nn::PassUse::kInference,
                                 minibatch),
            at::zeros_like(now_.actions), at::zeros_like(minibatch.reward)},
      functions_(shape, parameters_, minibatch.dropout) {}

DrawnActions GaussianActor::Draw(const at::Tensor& state, const at::Tensor& noise) const {
  return SquashedDraw(distribution_, functions_(state).squeeze(1), noise);
}

void GaussianActor::Descend(const at::Tensor& loss, double learning_rate, double average_rate,
                            at::Tensor& norm_total) {
  functions_.Differentiate(loss, gradient_);
  Step(learning_rate, average_rate, norm_total, 1);
}

SampledActions GaussianActor::Sample(const at::Tensor& state, const at::Tensor& noise) {
  SLALOM_CHECK(state.is_same(state_));
  noise_ = noise;
  return Sample(now_, noise);
}

SampledActions GaussianActor::SampleNext(const at::Tensor& next_state, const at::Tensor& noise) {
  SLALOM_CHECK(next_state.is_same(next_state_));
  return Sample(next_, noise);
}

SampledActions GaussianActor::Sample(Draws& draws, const at::Tensor& noise) {
  network_.Forward(draws.pass);
  SquashedSample(distribution_, draws.pass.output(), noise, draws.actions, draws.log_probability);
  return {draws.actions, draws.log_probability};
}

const at::Tensor& GaussianActor::ActNext() {
  network_.Forward(next_.pass);
  CopyActions(next_.pass.output().narrow(1, 0, next_.actions.size(1)), next_.actions);
  nn::Tanh(next_.actions);
  return next_.actions;
}

void GaussianActor::PolicyGradientStep(const at::Tensor& action_gradient,
                                       const at::Tensor& log_temperature, double learning_rate,
                                       double average_rate, at::Tensor& norm_total) {
  SquashedGradient(distribution_, now_.pass.output(), noise_, now_.actions, action_gradient,
                   log_temperature, now_.pass.output_gradient());
  network_.ParameterGradient(now_.pass);
  Step(learning_rate, average_rate, norm_total, static_cast<int>(gradients_.size(0)));
}

void GaussianActor::Step(double learning_rate, double average_rate, at::Tensor& norm_total,
                         int num_gradients) {
  const PolyakAverage average{average_parameters_, average_rate};
  adam_.Step(learning_rate, std::span(&average, average_rate > 0.0 ? 1 : 0), norm_total,
             num_gradients);
}

void GaussianActor::StartFrom(const at::Tensor& parameters) {
  parameters_.copy_(parameters);
  average_parameters_.copy_(parameters);
}

void GaussianActor::SaveState(nn::TensorMap& tensors) const {
  tensors["actor.parameters"] = StoreTensor(parameters_);
  tensors["actor.average_parameters"] = StoreTensor(average_parameters_);
  adam_.SaveState("actor.adam", tensors);
}

void GaussianActor::LoadState(const nn::TensorFile& file) {
  ReadTensor(file, "actor.parameters", parameters_);
  ReadTensor(file, "actor.average_parameters", average_parameters_);
  adam_.LoadState("actor.adam", file);
}

}  // namespace slalom::learner
