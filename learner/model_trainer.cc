#include "learner/model_trainer.h"

#include <ATen/ATen.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/error.h"
#include "learner/stored_state.h"
#include "policy/nn/network.h"

namespace slalom::learner {
namespace {

/// Number of loads between two choices of elites. With 5 batches of 128 and 5 % held out, these are
/// 8,000 held-out transitions, and those that a member of an ensemble counts with weight 0.
constexpr std::int64_t kElitePeriod = 250;

at::Tensor InitialWeights(const nn::ModelShape& shape, std::uint64_t seed, at::Device device) {
  base::Random random(base::DeriveSeed(seed, "model weights"));
  return InitialParameters(shape.network, shape.ensemble, random, device);
}

double Uniform(std::uint64_t seed, std::string_view purpose, std::uint64_t a, std::uint64_t b) {
  return static_cast<double>(base::DeriveSeed(seed, purpose, {a, b}) >> 11) * 0x1.0p-53;
}

/// Returns the quantile of the Poisson distribution with mean 1.
float PoissonOne(double quantile) {
  double term = std::exp(-1.0);
  double sum = term;
  int k = 0;
  while (quantile >= sum && k < 16) sum += term /= ++k;
  return static_cast<float>(k);
}

std::vector<int> FirstMembers(int n) {
  std::vector<int> members(n);
  std::iota(members.begin(), members.end(), 0);
  return members;
}

std::string AdamName(int member) { return fmt::format("model.adam.{}", member); }

}  // namespace

ModelTrainer::ModelTrainer(const ModelTrainingConfig& config, const nn::ModelShape& shape,
                           const nn::FeatureMap& features, double reward_scale, bool mirror,
                           at::Device device, std::uint64_t seed, int num_rows)
    : config_(config),
      shape_(shape),
      num_rows_(ModelSample(config, shape.history(), num_rows).batch),
      history_(shape.history()),
      mirror_(base::DeriveSeed(seed, "model mirror")),
      bootstrap_seed_(base::DeriveSeed(seed, "model bootstrap")),
      reader_(features, history_, reward_scale, mirror, /*discount_factor=*/1.0),
      loaded_(num_rows_, history_, features.frame_size(), device),
      parameters_(InitialWeights(shape, seed, device)),
      gradient_(at::zeros_like(parameters_)),
      model_(shape, parameters_),
      gradient_model_(shape, gradient_),
      elites_(FirstMembers(NumElites(config, shape.ensemble))) {
  const std::int64_t size = shape.num_member_parameters();
  const std::int64_t batch = config.batch_size;
  const int updates = config.updates_per_update;
  for (int u = 0; u < updates; ++u) {
    const auto rows = [&](const at::Tensor& t) { return t.narrow(0, u * batch, batch); };
    passes_.emplace_back(shape, rows(loaded_.input));
    targets_.push_back({rows(loaded_.features),
                        rows(loaded_.next_features),
                        rows(loaded_.reward),
                        rows(loaded_.discount),
                        rows(loaded_.cost),
                        {}});
  }
  host_weights_ = at::zeros({shape.ensemble, updates * batch}, at::kFloat);
  weights_ = device.is_cpu() ? host_weights_ : at::zeros_like(host_weights_, parameters_.options());
  const auto figures = at::TensorOptions(at::kDouble).device(device);
  figures_ = at::zeros({shape.ensemble, kNumModelFigures}, figures);
  norm_total_ = at::zeros({1}, figures);
  figures_at_choice_ = at::zeros({shape.ensemble, kNumModelFigures}, at::kDouble);
  figures_at_reading_ = at::zeros({kNumModelFigures + 1}, at::kDouble);
  for (int e = 0; e < shape.ensemble; ++e) {
    member_values_.push_back(parameters_.narrow(0, e * size, size));
    adam_.emplace_back(member_values_.back(), gradient_.narrow(0, e * size, size));
    figure_rows_.push_back(figures_.select(0, e));
    for (int u = 0; u < updates; ++u) {
      weight_views_.push_back(weights_.select(0, e).narrow(0, u * batch, batch));
    }
  }
}

void ModelTrainer::Load(const replay::SampledRows& rows) {
  reader_.Read(rows, mirror_, loaded_);
  loaded_.room.copy_(loaded_.actions);
  const std::int64_t learned = host_weights_.size(1);
  for (int e = 0; e < shape_.ensemble; ++e) {
    float* const weights = host_weights_.data_ptr<float>() + e * learned;
    for (std::int64_t i = 0; i < learned; ++i) {
      const auto row = static_cast<std::uint64_t>(rows.sequence[i]);
      const auto member = static_cast<std::uint64_t>(e);
      const bool held_out = Uniform(bootstrap_seed_, "held out", row, 0) < config_.held_out;
      weights[i] = held_out ? 0.0f
                   : shape_.ensemble == 1
                       ? 1.0f
                       : PoissonOne(Uniform(bootstrap_seed_, "bootstrap", row, member));
    }
  }
  if (!weights_.is_same(host_weights_)) weights_.copy_(host_weights_);
}

void ModelTrainer::Update() {
  const int updates = config_.updates_per_update;
  const double state_scale =
      config_.state_loss == StateLoss::kSum ? 1.0 : 1.0 / static_cast<double>(shape_.num_predicted);
  for (int u = 0; u < updates; ++u) {
    nn::ModelPass& pass = passes_[u];
    ModelTargets& targets = targets_[u];
    for (int e = 0; e < shape_.ensemble; ++e) {
      targets.weight = weight_views_[e * updates + u];
      model_.Forward(pass, e);
      ModelLoss(shape_, targets, state_scale, pass, figure_rows_[e]);
      model_.member(e).ParameterGradient(pass.network(), gradient_model_.member(e));
      if (config_.weight_decay > 0.0) {
        member_values_[e].mul_(1.0 - config_.learning_rate * config_.weight_decay);
      }
      adam_[e].Step(config_.learning_rate, {}, norm_total_);
    }
  }
  const std::int64_t loads = (num_updates_ += updates) / updates;
  if (config_.elites > 0 && loads % kElitePeriod == 0) ChooseElites();
}

void ModelTrainer::ChooseElites() {
  const at::Tensor figures = figures_.to(at::kCPU, at::kDouble, false, /*copy=*/true);
  const at::Tensor recent = figures - figures_at_choice_;
  figures_at_choice_ = figures;
  const at::Tensor error =
      recent.select(1, shape_.probabilistic ? kHeldOutLikelihood : kHeldOutSquares) /
      recent.select(1, kHeldOutCount);
  if (!at::isfinite(error).all().item<bool>()) return;
  const double* const values = error.data_ptr<double>();
  elites_ = FirstMembers(shape_.ensemble);
  std::ranges::stable_sort(elites_, [&](int a, int b) { return values[a] < values[b]; });
  elites_.resize(config_.elites);
}

std::vector<float> ModelTrainer::EliteParameters() const {
  const at::Tensor host = parameters_.to(at::kCPU);
  const std::int64_t size = shape_.num_member_parameters();
  std::vector<float> elites;
  elites.reserve(elites_.size() * static_cast<std::size_t>(size));
  for (const int member : elites_) {
    const float* const begin = host.data_ptr<float>() + member * size;
    elites.insert(elites.end(), begin, begin + size);
  }
  return elites;
}

ModelStats ModelTrainer::ReadStats() {
  const at::Tensor sums = at::cat({figures_.sum(0), norm_total_}).to(at::kCPU);
  const at::Tensor recent = sums - figures_at_reading_;
  figures_at_reading_ = sums;
  const double* const f = recent.data_ptr<double>();
  ModelStats stats;
  stats.num_updates = num_updates_ - updates_at_reading_;
  const double steps = static_cast<double>(std::max<std::int64_t>(1, stats.num_updates)) *
                       static_cast<double>(shape_.ensemble);
  stats.loss = (f[kModelStateLoss] + f[kModelRewardLoss] + f[kModelTerminationLoss]) /
               std::max(f[kModelWeight], 1.0);
  stats.gradient_norm = f[kNumModelFigures] / steps;
  const double held = f[kHeldOutCount];  // If 0, the quotients are 0 / 0: NaN.
  stats.error = std::sqrt(f[kHeldOutSquares] / held);
  stats.change = std::sqrt(f[kHeldOutChange] / held);
  stats.likelihood_nats = f[kHeldOutLikelihood] / held;
  stats.reward_error = std::sqrt(f[kHeldOutReward] / held);
  stats.termination_nats = f[kHeldOutTermination] / held;
  stats.inside_50 = f[kHeldOutInside50] / held;
  stats.inside_90 = f[kHeldOutInside90] / held;
  updates_at_reading_ = num_updates_;
  return stats;
}

bool ModelTrainer::is_finite() const { return at::isfinite(parameters_).all().item<bool>(); }

void ModelTrainer::SaveState(nn::TensorMap& tensors) const {
  tensors["model.parameters"] = StoreTensor(parameters_);
  for (int e = 0; e < shape_.ensemble; ++e) adam_[e].SaveState(AdamName(e), tensors);
  const std::array<std::int64_t, 2> counters = {num_updates_, updates_at_reading_};
  tensors["model.counters"] = nn::StoredTensor::Of(std::span<const std::int64_t>(counters));
  const std::vector<std::int64_t> elites(elites_.begin(), elites_.end());
  tensors["model.elites"] = nn::StoredTensor::Of(std::span<const std::int64_t>(elites));
  tensors["model.bootstrap_seed"] =
      nn::StoredTensor::Of(std::span<const std::uint64_t>(&bootstrap_seed_, 1));
  tensors["model.mirror_random"] = StoreRandom(mirror_);
  const at::Tensor figures = at::cat({figures_.flatten().to(at::kCPU), norm_total_.to(at::kCPU),
                                      figures_at_choice_.flatten(), figures_at_reading_});
  tensors["model.figures"] = nn::StoredTensor::Of(std::span<const double>(
      figures.data_ptr<double>(), static_cast<std::size_t>(figures.numel())));
}

void ModelTrainer::LoadState(const nn::TensorFile& file) {
  ReadTensor(file, "model.parameters", parameters_);
  for (int e = 0; e < shape_.ensemble; ++e) adam_[e].LoadState(AdamName(e), file);
  std::array<std::int64_t, 2> counters;
  file.Read("model.counters", std::span(counters));
  num_updates_ = counters[0];
  updates_at_reading_ = counters[1];
  std::vector<std::int64_t> elites(elites_.size());
  file.Read("model.elites", std::span(elites));
  if (std::ranges::any_of(elites, [&](auto e) { return e < 0 || e >= shape_.ensemble; })) {
    throw base::Error("{}: 'model.elites' names members beyond the {} of the ensemble", file.source,
                      shape_.ensemble);
  }
  elites_.assign(elites.begin(), elites.end());
  file.Read("model.bootstrap_seed", std::span(&bootstrap_seed_, 1));
  ReadRandom(file, "model.mirror_random", mirror_);
  const std::int64_t size = figures_.numel();
  at::Tensor figures = at::zeros({2 * size + 1 + figures_at_reading_.numel()}, at::kDouble);
  file.Read("model.figures",
            std::span(figures.data_ptr<double>(), static_cast<std::size_t>(figures.numel())));
  figures_.copy_(figures.narrow(0, 0, size).view(figures_.sizes()));
  norm_total_.copy_(figures.narrow(0, size, 1));
  figures_at_choice_.copy_(figures.narrow(0, size + 1, size).view(figures_.sizes()));
  figures_at_reading_.copy_(figures.narrow(0, 2 * size + 1, figures_at_reading_.numel()));
}

}  // namespace slalom::learner
