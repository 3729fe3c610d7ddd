#include "learner/critics.h"

#include "learner/value_ops.h"

namespace slalom::learner {
namespace {

at::Tensor InitialParameters(const policy::MlpShape& shape, int num_networks, base::Random& random,
                             at::Device device) {
  const std::int64_t size = shape.num_parameters();
  std::vector<float> host(static_cast<std::size_t>(num_networks * size));
  for (int i = 0; i < num_networks; ++i) {
    policy::InitialiseParameters(shape, random, std::span(host).subspan(i * size, size));
  }
  return at::from_blob(host.data(), {num_networks * size}, at::kFloat).clone().to(device);
}

}  // namespace

Critics::Critics(const policy::MlpShape& shape, int num_critics, base::Random& random,
                 const Minibatch& minibatch)
    : parameters_(InitialParameters(shape, num_critics, random, minibatch.input.device())),
      target_parameters_(parameters_.clone()),
      gradient_(at::zeros_like(parameters_)),
      adam_(parameters_, gradient_) {
  const std::int64_t size = shape.num_parameters();
  for (int k = 0; k < num_critics; ++k) {
    critics_.push_back({policy::Mlp(shape, parameters_.narrow(0, k * size, size)),
                        policy::Mlp(shape, target_parameters_.narrow(0, k * size, size)),
                        policy::Mlp(shape, gradient_.narrow(0, k * size, size)),
                        policy::MlpPass(shape, minibatch.input),
                        policy::MlpPass(shape, minibatch.next_input)});
    target_values_.push_back(critics_.back().target_pass.output());
  }
}

void Critics::ComputeTarget(const Minibatch& minibatch, at::Tensor& y) {
  for (Critic& critic : critics_) critic.target.Forward(critic.target_pass);
  MinimumTarget(target_values_, minibatch.reward, minibatch.discount, y);
}

void Critics::Regress(const at::Tensor& y, double learning_rate, double polyak_rate,
                      at::Tensor& loss_total, at::Tensor& value_total, at::Tensor& norm_total,
                      const Importance* importance) {
  if (importance != nullptr) importance->error.zero_();
  for (Critic& critic : critics_) {
    critic.network.Forward(critic.pass);
    SquaredError(critic.pass.output(), y, critic.pass.output_gradient(), loss_total, value_total);
    if (importance != nullptr) {
      WeighError(critic.pass.output(), y, importance->weight,
                 1.0 / static_cast<double>(critics_.size()), critic.pass.output_gradient(),
                 importance->error);
    }
    critic.network.ParameterGradient(critic.pass, critic.gradient);
  }
  const Follower target{target_parameters_, polyak_rate};
  adam_.Step(learning_rate, std::span(&target, polyak_rate > 0.0 ? 1 : 0), norm_total);
}

const at::Tensor& Critics::ActionGradient(at::Tensor& value_total) {
  Critic& critic = critics_.front();
  critic.network.Forward(critic.pass);
  AddMean(critic.pass.output(), value_total);
  critic.pass.output_gradient().fill_(-1.0 / static_cast<double>(critic.pass.output().size(0)));
  critic.network.ExtraGradient(critic.pass);
  return critic.pass.extra_gradient();
}

void Critics::SaveState(policy::TensorMap& tensors) const {
  tensors["critics.parameters"] = StoreTensor(parameters_);
  tensors["critics.target_parameters"] = StoreTensor(target_parameters_);
  adam_.SaveState("critics.adam", tensors);
}

void Critics::LoadState(const policy::TensorFile& file) {
  ReadTensor(file, "critics.parameters", parameters_);
  ReadTensor(file, "critics.target_parameters", target_parameters_);
  adam_.LoadState("critics.adam", file);
}

}  // namespace slalom::learner
