#include "learner/learner.h"

#include <ATen/ATen.h>
#include <fmt/format.h>
#include <torch/cuda.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "learner/algorithm.h"
#include "learner/constraint.h"
#include "learner/imagination.h"
#include "learner/minibatch.h"
#include "learner/model_trainer.h"
#include "learner/prediction_error.h"
#include "learner/stored_state.h"
#include "policy/nn/feature_map.h"

namespace slalom::learner {
namespace {

at::Device ChooseDevice(DeviceChoice choice) {
  const bool has_cuda = torch::cuda::is_available();
  base::ThrowIf(
      choice == DeviceChoice::kCuda && !has_cuda,
      "learner.device: found \"cuda\", but LibTorch finds no GPU here; use \"auto\" or \"cpu\"");
  return at::Device(choice != DeviceChoice::kCpu && has_cuda ? at::kCUDA : at::kCPU);
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
        minibatch(method.learner.batch_size, spec.network.history, features.frame_size(), device,
                  spec.action_size),
        totals(device) {
    minibatch.dropout = &dropout;
    // Networks with dropout draw from one stream, in turn.
    if (method.learner.threads > 1 && device.is_cpu() && spec.network.dropout == 0.0) {
      minibatch.parallel = &parallel.emplace(method.learner.threads);
    }
    if (method.constraint.kind != ConstraintKind::kNone) {
      base::Random weights(base::DeriveSeed(seed, "cost critic weights"));
      constraint.emplace(method.constraint, spec.critic_shape(), weights, minibatch, totals);
    }
    algorithm = MakeAlgorithm({.config = method.learner,
                               .spec = spec,
                               .seed = seed,
                               .initial_weights = initial_weights,
                               .minibatch = minibatch,
                               .totals = totals,
                               .constraint = constraint ? &*constraint : nullptr});
    if (method.model.kind == nn::ModelKind::kNone) return;
    model.emplace(method.model_training,
                  nn::MakeModelShape(method.model, spec.network, features.frame_size(),
                                     spec.observation, spec.planning.goal),
                  features, method.learner.reward_scale, method.learner.mirror, device, seed,
                  NumStartingStates(method.imagination, method.learner.batch_size));
    if (method.imagination.kind == ImaginationKind::kNone) return;
    imagination.emplace(method.imagination, method.learner.gamma, *model, *algorithm, minibatch,
                        seed);
  }

  policy::PolicySnapshot MakeSnapshot(const policy::PolicySpec& spec,
                                      const at::Tensor& actor) const {
    policy::PolicySnapshot snapshot{totals.num_updates(), spec, CopyToHost(actor), nullptr,
                                    nullptr};
    if (!model) return snapshot;
    const at::Tensor& critics = algorithm->critic_parameters();
    snapshot.critic_weights =
        CopyToHost(critics.narrow(0, 0, critics.numel() / algorithm->num_critics()));
    snapshot.model_weights = std::make_shared<const std::vector<float>>(model->EliteParameters());
    return snapshot;
  }

  at::Device device;
  base::Random initial_weights;
  base::Random mirror;
  base::Random dropout;
  std::optional<base::ParallelFor> parallel;
  nn::FeatureMap features;
  MinibatchReader reader;
  Minibatch minibatch;
  Totals totals;
  std::optional<Constraint> constraint;
  std::unique_ptr<Algorithm> algorithm;
  std::optional<ModelTrainer> model;
  std::optional<Imagination> imagination;
  at::Tensor host_td_errors;               // [B]
  std::optional<LearnerStats> last_stats;  // The last reading with updates.
  double rate = LearnerStats::kNone;       // Factor on the learning rates in the last update.
};

Learner::Learner(const MethodConfig& method, const policy::PolicySpec& spec, std::uint64_t seed,
                 const std::optional<policy::PolicySnapshot>& first)
    : method_(method), spec_(spec), sample_specs_(SampleSpecs(method, spec)) {
  SLALOM_CHECK(spec.distribution == DistributionOf(method.learner));
  SLALOM_CHECK(spec.planning == PlanningOf(method, spec.planning.goal));
  parts_ = std::make_unique<Parts>(method_, spec_, seed);
  if (!first) return;
  const auto size = static_cast<std::int64_t>(first->weights->size());
  SLALOM_CHECK_EQ(size, parts_->algorithm->actor_parameters().numel());
  at::Tensor weights = at::empty({size}, at::kFloat);
  std::ranges::copy(*first->weights, weights.data_ptr<float>());
  parts_->algorithm->StartFrom(weights);
}

Learner::~Learner() = default;

void Learner::Update(std::span<const replay::SampledRows> batches, double progress) {
  Parts& p = *parts_;
  const double rate =
      1.0 + (method_.learner.final_learning_rate_fraction - 1.0) * std::clamp(progress, 0.0, 1.0);
  p.rate = rate;
  p.reader.Read(batches[0], p.mirror, p.minibatch);
  if (p.model) {
    p.model->Load(batches[1]);
    p.model->Update();
  }
  const bool imagines = p.imagination && p.imagination->ready();
  if (!imagines || p.imagination->adds_to_replayed()) UpdateAlgorithm(rate);
  if (!imagines) return;
  p.imagination->Begin(num_updates());
  for (int k = 0; k < p.imagination->num_batches(); ++k) {
    p.imagination->Fill(k);
    UpdateAlgorithm(rate);
  }
}

void Learner::UpdateAlgorithm(double rate) {
  parts_->totals.CountUpdate();
  try {
    parts_->algorithm->Update(rate);
  } catch (const c10::Error& error) {
    // Such as shapes that do not fit, without LibTorch's list of addresses.
    throw base::Error("learner.algorithm \"{}\": {}", method_.learner.algorithm,
                      error.what_without_backtrace());
  }
}

std::span<const float> Learner::TdErrors() {
  Parts& p = *parts_;
  p.host_td_errors = p.algorithm->td_errors().to(at::kCPU);
  return {p.host_td_errors.data_ptr<float>(), static_cast<std::size_t>(p.host_td_errors.numel())};
}

void Learner::ObserveEpisodes(double mean_cost, std::int64_t finished) {
  if (parts_->constraint) parts_->constraint->Observe(mean_cost, finished);
}

LearnerStats Learner::ReadStats() {
  Parts& p = *parts_;
  const bool has_new = p.totals.has_new();
  LearnerStats stats = p.totals.Read(p.algorithm->num_critics(), Constraint::kNumCritics);
  if (spec_.distribution.is_deterministic()) stats.policy_entropy_nats = LearnerStats::kNone;
  stats.actor_learning_rate = p.rate * method_.learner.actor_learning_rate;
  if (p.algorithm->num_critics() > 0) {
    stats.critic_learning_rate = p.rate * method_.learner.critic_learning_rate;
  }
  p.algorithm->Describe(stats);
  if (p.constraint) {
    p.constraint->Describe(stats);
  } else {
    stats.cost_q_mean = stats.cost_critic_loss = LearnerStats::kNone;
  }
  if (p.model) stats.model = p.model->ReadStats();
  if (p.imagination) {
    stats.imagined_transitions = static_cast<double>(p.imagination->num_transitions());
  }
  if (has_new) p.last_stats = stats;
  return stats;
}

double Learner::PredictionError(const replay::SampledRows& windows) const {
  const Parts& p = *parts_;
  if (!p.model) return LearnerStats::kNone;
  const std::vector<double> errors =
      PredictionErrors(p.model->model(), p.model->elites().front(), p.features, windows, p.device);
  return errors.empty() ? LearnerStats::kNone : errors.back();
}

std::optional<std::string> Learner::FindFault() const {
  const Parts& p = *parts_;
  if (!IsFinite(p.algorithm->actor_parameters())) return "the actor's weights are no longer finite";
  if (!IsFinite(p.algorithm->critic_parameters())) {
    return "the critics' weights are no longer finite";
  }
  if (p.constraint && !IsFinite(p.constraint->critic_parameters())) {
    return "the cost critics' weights are no longer finite";
  }
  if (p.model && !p.model->is_finite()) {
    return "the transition model's weights are no longer finite";
  }
  if (p.algorithm->num_critics() > 0 && p.last_stats &&
      !(std::abs(p.last_stats->q_mean) <= method_.learner.divergence_limit)) {
    return fmt::format("the mean action value is {:.3g}, beyond learner.divergence_limit = {:.3g}",
                       p.last_stats->q_mean, method_.learner.divergence_limit);
  }
  return std::nullopt;
}

policy::PolicySnapshot Learner::Snapshot() const {
  return parts_->MakeSnapshot(spec_, parts_->algorithm->actor_parameters());
}

policy::PolicySnapshot Learner::BestSnapshot() const {
  return parts_->MakeSnapshot(spec_, parts_->algorithm->average_parameters());
}

std::int64_t Learner::num_updates() const { return parts_->totals.num_updates(); }

std::string Learner::device() const { return parts_->device.is_cpu() ? "cpu" : "cuda"; }

void Learner::SaveState(nn::TensorMap& tensors) const {
  const Parts& p = *parts_;
  p.algorithm->SaveState(tensors);
  if (p.constraint) p.constraint->SaveState(tensors);
  if (p.model) p.model->SaveState(tensors);
  if (p.imagination) p.imagination->SaveState(tensors);
  p.totals.SaveState(tensors);
  tensors["learner.mirror_random"] = StoreRandom(p.mirror);
  tensors["learner.dropout_random"] = StoreRandom(p.dropout);
}

void Learner::LoadState(const nn::TensorFile& file) {
  Parts& p = *parts_;
  p.algorithm->LoadState(file);
  if (p.constraint) p.constraint->LoadState(file);
  if (p.model) p.model->LoadState(file);
  if (p.imagination) p.imagination->LoadState(file);
  p.totals.LoadState(file);
  ReadRandom(file, "learner.mirror_random", p.mirror);
  ReadRandom(file, "learner.dropout_random", p.dropout);
}

}  // namespace slalom::learner
