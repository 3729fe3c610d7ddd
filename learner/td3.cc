#include "learner/td3.h"

#include <ATen/ATen.h>
#include <fmt/format.h>
#include <torch/cuda.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "learner/critics.h"
#include "learner/deterministic_actor.h"
#include "learner/minibatch.h"
#include "learner/value_ops.h"

namespace slalom::learner {
namespace {

constexpr int kNumCritics = 2;

at::Device ChooseDevice(const std::string& choice) {
  const bool has_cuda = torch::cuda::is_available();
  if (choice == "cuda" && !has_cuda) {
    throw base::Error(
        "learner.device: found \"cuda\", but LibTorch finds no GPU here; use \"auto\" or \"cpu\"");
  }
  return at::Device(choice != "cpu" && has_cuda ? at::kCUDA : at::kCPU);
}

std::shared_ptr<const std::vector<float>> CopyToHost(const at::Tensor& parameters) {
  const at::Tensor host = parameters.to(at::kCPU);
  const float* const begin = host.data_ptr<float>();
  return std::make_shared<const std::vector<float>>(begin, begin + host.numel());
}

/// Totals since the last reading, kept on the device.
enum Total { kCriticLoss, kQ, kCriticNorm, kActorQ, kActorNorm, kNumTotals };

}  // namespace

struct Td3::Parts {
  Parts(const Td3Config& config, const policy::PolicySpec& spec, std::uint64_t seed)
      : device(ChooseDevice(config.device)),
        initial_weights(base::DeriveSeed(seed, "learner weights")),
        target_noise(base::DeriveSeed(seed, "target noise")),
        mirror(base::DeriveSeed(seed, "mirror")),
        features(spec.observation, spec.network),
        reader(features, spec.network.history, config.reward_scale, config.mirror),
        minibatch(config.batch_size, spec.network.history, features.frame_size(), device),
        actor(policy::ActorShape(spec.network, features.frame_size()), initial_weights, minibatch),
        critics(policy::CriticShape(spec.network, features.frame_size()), kNumCritics,
                initial_weights, minibatch),
        host_noise(at::zeros({config.batch_size, 2}, at::kFloat)),
        noise(device.is_cpu() ? host_noise
                              : at::zeros({config.batch_size, 2}, minibatch.reward.options())),
        target(at::zeros_like(minibatch.reward)),
        error(at::zeros_like(minibatch.reward)),
        totals(at::zeros({kNumTotals}, at::TensorOptions(at::kDouble).device(device))) {
    for (int i = 0; i < kNumTotals; ++i) total.push_back(totals.narrow(0, i, 1));
  }

  at::Device device;
  base::Random initial_weights;
  base::Random target_noise;
  base::Random mirror;
  policy::FeatureMap features;
  MinibatchReader reader;
  Minibatch minibatch;
  DeterministicActor actor;
  Critics critics;
  at::Tensor host_noise;          // [B, A]
  at::Tensor noise;               // [B, A], epsilon
  at::Tensor target;              // [B], y
  at::Tensor error;               // [B], |Q(s, a) - y|, where prioritized
  at::Tensor host_error;          // [B]
  at::Tensor totals;              // [kNumTotals] float64
  std::vector<at::Tensor> total;  // views of `totals`, [1] each
  std::int64_t num_updates = 0;
  std::int64_t num_actor_updates = 0;
  std::int64_t updates_at_reading = 0;
  std::int64_t actor_updates_at_reading = 0;
  Td3Stats last_stats;
};

Td3::Td3(const Td3Config& config, const policy::PolicySpec& spec, std::uint64_t seed)
    : config_(config), spec_(spec), parts_(std::make_unique<Parts>(config, spec, seed)) {}

Td3::~Td3() = default;

replay::SampleSpec Td3::sample_spec() const {
  return {.batch = config_.batch_size,
          .history = spec_.network.history,
          .n_step = config_.n_step,
          .gamma = config_.gamma,
          .prioritized = config_.prioritized,
          .importance_exponent = config_.importance_exponent};
}

std::span<const float> Td3::Errors() {
  Parts& p = *parts_;
  p.host_error = p.error.to(at::kCPU);
  return {p.host_error.data_ptr<float>(), static_cast<std::size_t>(p.host_error.numel())};
}

void Td3::Load(const replay::SampledRows& rows) {
  Parts& p = *parts_;
  p.reader.Read(rows, p.mirror, p.minibatch);
  // epsilon ~ clip(N(0, sigma), -c, c)
  float* const noise = p.host_noise.data_ptr<float>();
  for (std::int64_t i = 0; i < p.host_noise.numel(); ++i) {
    noise[i] = static_cast<float>(std::clamp(config_.target_noise * p.target_noise.Normal(),
                                             -config_.noise_clip, config_.noise_clip));
  }
  if (!p.device.is_cpu()) p.noise.copy_(p.host_noise);
}

void Td3::Update(double progress) {
  Parts& p = *parts_;
  const double rate =
      1.0 + (config_.final_learning_rate_fraction - 1.0) * std::clamp(progress, 0.0, 1.0);
  ++p.num_updates;
  const bool update_actor = p.num_updates % config_.policy_delay == 0;
  // Targets move only together with the actor.
  const double polyak_rate = update_actor ? config_.tau : 0.0;

  // Target policy smoothing, equation 14: a' = clip(pi'(s') + epsilon, -1, 1)
  AddClippedNoise(p.actor.ActTarget(), p.noise, p.minibatch.next_actions);
  // Clipped double Q-learning, equation 10: y = r + gamma^n min_k Q'_k(s', a')
  p.critics.ComputeTarget(p.minibatch, p.target);
  // theta_k <- argmin mean (Q_k(s, a) - y)^2, and theta'_k <- tau theta_k + (1 - tau) theta'_k
  const Critics::Importance importance{p.minibatch.weight, p.error};
  p.critics.Regress(p.target, rate * config_.critic_learning_rate, polyak_rate,
                    p.total[kCriticLoss], p.total[kQ], p.total[kCriticNorm],
                    config_.prioritized ? &importance : nullptr);
  if (!update_actor) return;

  // Deterministic policy gradient: grad_phi J = mean grad_a Q_1(s, a)|a=pi(s) grad_phi pi(s)
  CopyActions(p.actor.Act(), p.minibatch.actions);
  const at::Tensor& action_gradient = p.critics.ActionGradient(p.total[kActorQ]);
  ++p.num_actor_updates;
  // Early on the average forgets its untrained beginning: rate 5 / (5 + n) while that is faster.
  const double average_rate =
      config_.average_rate == 0.0
          ? 0.0
          : std::max(config_.average_rate, 5.0 / (5.0 + static_cast<double>(p.num_actor_updates)));
  p.actor.Improve(action_gradient, rate * config_.actor_learning_rate, polyak_rate, average_rate,
                  p.total[kActorNorm]);
}

Td3Stats Td3::ReadStats() {
  Parts& p = *parts_;
  const at::Tensor host = p.totals.to(at::kCPU);
  const double* const total = host.data_ptr<double>();
  Td3Stats stats;
  stats.num_updates = p.num_updates - p.updates_at_reading;
  const double updates = static_cast<double>(std::max<std::int64_t>(1, stats.num_updates));
  const double actor_updates = static_cast<double>(
      std::max<std::int64_t>(1, p.num_actor_updates - p.actor_updates_at_reading));
  stats.critic_loss = total[kCriticLoss] / (updates * kNumCritics);
  stats.q_mean = total[kQ] / (updates * kNumCritics);
  stats.critic_gradient_norm = total[kCriticNorm] / updates;
  stats.actor_q_mean = total[kActorQ] / actor_updates;
  stats.actor_gradient_norm = total[kActorNorm] / actor_updates;
  p.totals.zero_();
  p.updates_at_reading = p.num_updates;
  p.actor_updates_at_reading = p.num_actor_updates;
  p.last_stats = stats;
  return stats;
}

std::optional<std::string> Td3::FindFault() const {
  const Parts& p = *parts_;
  const auto is_finite = [](const at::Tensor& t) { return at::isfinite(t).all().item<bool>(); };
  if (!is_finite(p.actor.parameters())) return "the actor's weights are no longer finite";
  if (!is_finite(p.critics.parameters())) return "the critics' weights are no longer finite";
  if (!(std::abs(p.last_stats.q_mean) <= config_.divergence_limit)) {
    return fmt::format("the mean action value is {:.3g}, beyond learner.divergence_limit = {:.3g}",
                       p.last_stats.q_mean, config_.divergence_limit);
  }
  return std::nullopt;
}

policy::PolicySnapshot Td3::Snapshot() const {
  return {parts_->num_updates, spec_, CopyToHost(parts_->actor.parameters())};
}

policy::PolicySnapshot Td3::AveragedSnapshot() const {
  if (config_.average_rate == 0.0) return Snapshot();
  return {parts_->num_updates, spec_, CopyToHost(parts_->actor.average_parameters())};
}

std::int64_t Td3::num_updates() const { return parts_->num_updates; }

std::string Td3::device() const { return parts_->device.is_cpu() ? "cpu" : "cuda"; }

void Td3::SaveState(policy::TensorMap& tensors) const {
  const Parts& p = *parts_;
  p.actor.SaveState(tensors);
  p.critics.SaveState(tensors);
  const std::array<std::int64_t, 4> counters = {p.num_updates, p.num_actor_updates,
                                                p.updates_at_reading, p.actor_updates_at_reading};
  tensors["td3.counters"] = policy::StoredTensor::Of(std::span<const std::int64_t>(counters));
  tensors["td3.target_noise_random"] =
      policy::StoredTensor::Of(std::span<const std::uint64_t>(p.target_noise.state()));
  tensors["td3.mirror_random"] =
      policy::StoredTensor::Of(std::span<const std::uint64_t>(p.mirror.state()));
  const at::Tensor totals = p.totals.to(at::kCPU);
  tensors["td3.totals"] =
      policy::StoredTensor::Of(std::span<const double>(totals.data_ptr<double>(), kNumTotals));
}

void Td3::LoadState(const policy::TensorFile& file) {
  Parts& p = *parts_;
  p.actor.LoadState(file);
  p.critics.LoadState(file);
  std::array<std::int64_t, 4> counters;
  file.Read("td3.counters", std::span(counters));
  std::tie(p.num_updates, p.num_actor_updates, p.updates_at_reading, p.actor_updates_at_reading) =
      std::tuple(counters[0], counters[1], counters[2], counters[3]);
  base::Random::State state;
  file.Read("td3.target_noise_random", std::span(state));
  p.target_noise.set_state(state);
  file.Read("td3.mirror_random", std::span(state));
  p.mirror.set_state(state);
  at::Tensor totals = at::zeros({kNumTotals}, at::kDouble);
  file.Read("td3.totals", std::span(totals.data_ptr<double>(), kNumTotals));
  p.totals.copy_(totals);
}

}  // namespace slalom::learner
