#include "learner/learner.h"

#include <ATen/ATen.h>
#include <fmt/format.h>
#include <torch/cuda.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "learner/algorithm.h"
#include "learner/constraint.h"
#include "learner/minibatch.h"
#include "policy/feature_map.h"

namespace slalom::learner {
namespace {

at::Device ChooseDevice(const std::string& choice) {
  const bool has_cuda = torch::cuda::is_available();
  if (choice == "cuda" && !has_cuda) {
    throw base::Error(
        "learner.device: found \"cuda\", but LibTorch finds no GPU here; use \"auto\" or \"cpu\"");
  }
  return at::Device(choice != "cpu" && has_cuda ? at::kCUDA : at::kCPU);
}

const MethodConfig& Checked(const MethodConfig& method) {
  const LearnerConfig& learner = method.learner;
  if (learner.algorithm == "sac" && learner.log_std_min > learner.log_std_max) {
    throw base::Error(
        fmt::format("learner.log_std_min is {}, expected at most learner.log_std_max = {}",
                    learner.log_std_min, learner.log_std_max));
  }
  const ConstraintConfig& constraint = method.constraint;
  if (constraint.kind == "fixed" && constraint.multiplier == 0.0) {
    throw base::Error(
        "constraint.multiplier is 0, expected more where constraint.kind is \"fixed\": a cost that "
        "weighs nothing constrains nothing");
  }
  if (constraint.multiplier > constraint.multiplier_max) {
    throw base::Error(
        fmt::format("constraint.multiplier is {}, expected at most constraint.multiplier_max = {}",
                    constraint.multiplier, constraint.multiplier_max));
  }
  return method;
}

std::shared_ptr<const std::vector<float>> CopyToHost(const at::Tensor& parameters) {
  const at::Tensor host = parameters.to(at::kCPU);
  const float* const begin = host.data_ptr<float>();
  return std::make_shared<const std::vector<float>>(begin, begin + host.numel());
}

bool IsFinite(const at::Tensor& t) { return at::isfinite(t).all().item<bool>(); }

}  // namespace

struct Learner::Parts {
  Parts(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed)
      : device(ChooseDevice(method.learner.device)),
        initial_weights(base::DeriveSeed(seed, "learner weights")),
        mirror(base::DeriveSeed(seed, "mirror")),
        dropout(base::DeriveSeed(seed, "dropout")),
        features(spec.observation, spec.network),
        reader(features, spec.network.history, method.learner.reward_scale, method.learner.mirror,
               std::pow(method.learner.gamma, method.learner.extra_discount_steps)),
        minibatch(method.learner.batch_size, spec.network.history, features.frame_size(), device),
        totals(device) {
    minibatch.dropout = &dropout;
    if (method.constraint.kind != "none") {
      base::Random weights(base::DeriveSeed(seed, "cost critic weights"));
      constraint.emplace(method.constraint,
                         policy::CriticShape(spec.network, features.frame_size()), weights,
                         minibatch, totals);
    }
    algorithm = MakeAlgorithm({.config = method.learner,
                               .spec = spec,
                               .frame_size = features.frame_size(),
                               .seed = seed,
                               .initial_weights = initial_weights,
                               .minibatch = minibatch,
                               .totals = totals,
                               .constraint = constraint ? &*constraint : nullptr});
  }

  at::Device device;
  base::Random initial_weights;
  base::Random mirror;
  base::Random dropout;
  policy::FeatureMap features;
  MinibatchReader reader;
  Minibatch minibatch;
  Totals totals;
  std::optional<Constraint> constraint;
  std::unique_ptr<Algorithm> algorithm;
  at::Tensor host_errors;  // [B]
  LearnerStats last_stats;
};

Learner::Learner(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed)
    : method_(Checked(method)), spec_(spec) {
  SLALOM_CHECK(spec.distribution == DistributionOf(method.learner));
  parts_ = std::make_unique<Parts>(method_, spec_, seed);
}

Learner::~Learner() = default;

std::vector<replay::SampleSpec> Learner::SampleSpecs(const MethodConfig& method,
                                                     const policy::PolicySpec& spec) {
  const LearnerConfig& config = method.learner;
  return {{.batch = config.batch_size,
           .history = spec.network.history,
           .n_step = config.n_step,
           .gamma = config.gamma,
           .prioritized = config.prioritized,
           .importance_exponent = config.importance_exponent}};
}

void Learner::Update(std::span<const replay::SampledRows> batches, double progress) {
  Parts& p = *parts_;
  const double rate =
      1.0 + (method_.learner.final_learning_rate_fraction - 1.0) * std::clamp(progress, 0.0, 1.0);
  p.reader.Read(batches[0], p.mirror, p.minibatch);
  p.algorithm->Update(rate);
}

std::span<const float> Learner::Errors() {
  Parts& p = *parts_;
  p.host_errors = p.algorithm->errors().to(at::kCPU);
  return {p.host_errors.data_ptr<float>(), static_cast<std::size_t>(p.host_errors.numel())};
}

void Learner::ObserveEpisodes(double collisions, std::int64_t num_episodes) {
  if (parts_->constraint) parts_->constraint->Observe(collisions, num_episodes);
}

LearnerStats Learner::ReadStats() {
  Parts& p = *parts_;
  LearnerStats stats = p.totals.Read(p.algorithm->num_critics());
  if (spec_.distribution.is_deterministic()) stats.entropy = LearnerStats::kNone;
  p.algorithm->Describe(stats);
  if (p.constraint) {
    p.constraint->Describe(stats);
  } else {
    stats.cost_q_mean = stats.cost_critic_loss = LearnerStats::kNone;
  }
  p.last_stats = stats;
  return stats;
}

std::optional<std::string> Learner::FindFault() const {
  const Parts& p = *parts_;
  if (!IsFinite(p.algorithm->actor_parameters())) {
    return "the actor's weights are no longer finite";
  }
  if (!IsFinite(p.algorithm->critic_parameters())) {
    return "the critics' weights are no longer finite";
  }
  if (p.constraint && !IsFinite(p.constraint->critic_parameters())) {
    return "the cost critics' weights are no longer finite";
  }
  if (!(std::abs(p.last_stats.q_mean) <= method_.learner.divergence_limit)) {
    return fmt::format("the mean action value is {:.3g}, beyond learner.divergence_limit = {:.3g}",
                       p.last_stats.q_mean, method_.learner.divergence_limit);
  }
  return std::nullopt;
}

policy::PolicySnapshot Learner::Snapshot() const {
  return {num_updates(), spec_, CopyToHost(parts_->algorithm->actor_parameters())};
}

policy::PolicySnapshot Learner::BestSnapshot() const {
  return {num_updates(), spec_, CopyToHost(parts_->algorithm->average_parameters())};
}

std::int64_t Learner::num_updates() const { return parts_->totals.num_updates(); }

std::string Learner::device() const { return parts_->device.is_cpu() ? "cpu" : "cuda"; }

void Learner::SaveState(policy::TensorMap& tensors) const {
  const Parts& p = *parts_;
  p.algorithm->SaveState(tensors);
  if (p.constraint) p.constraint->SaveState(tensors);
  p.totals.SaveState(tensors);
  tensors["learner.mirror_random"] =
      policy::StoredTensor::Of(std::span<const std::uint64_t>(p.mirror.state()));
  tensors["learner.dropout_random"] =
      policy::StoredTensor::Of(std::span<const std::uint64_t>(p.dropout.state()));
}

void Learner::LoadState(const policy::TensorFile& file) {
  Parts& p = *parts_;
  p.algorithm->LoadState(file);
  if (p.constraint) p.constraint->LoadState(file);
  p.totals.LoadState(file);
  base::Random::State state;
  file.Read("learner.mirror_random", std::span(state));
  p.mirror.set_state(state);
  file.Read("learner.dropout_random", std::span(state));
  p.dropout.set_state(state);
}

}  // namespace slalom::learner
