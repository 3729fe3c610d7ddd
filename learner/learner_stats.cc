#include "learner/learner_stats.h"

#include <ATen/ATen.h>

#include <span>
#include <tuple>

namespace slalom::learner {

Totals::Totals(at::Device device)
    : sums_(at::zeros({static_cast<std::int64_t>(kNumTotals)},
                      at::TensorOptions(at::kDouble).device(device))) {
  for (std::size_t i = 0; i < kNumTotals; ++i) {
    views_[i] = sums_.narrow(0, static_cast<std::int64_t>(i), 1);
  }
}

LearnerStats Totals::Read(int num_critics, int num_cost_critics) {
  const at::Tensor host = sums_.to(at::kCPU);
  const auto total = [&host](Total t) { return host.data_ptr<double>()[static_cast<int>(t)]; };
  const auto updates = static_cast<double>(num_updates_ - updates_at_reading_);
  const auto actor_updates = static_cast<double>(num_actor_updates_ - actor_updates_at_reading_);
  const auto mean = [&total](Total t, double count) {
    return count > 0.0 ? total(t) / count : LearnerStats::kNone;
  };
  constexpr double kNone = LearnerStats::kNone;
  LearnerStats stats;
  stats.critic_loss = mean(Total::kCriticLoss, updates * num_critics);
  stats.q_mean = mean(Total::kQ, updates * num_critics);
  stats.critic_gradient_norm = num_critics > 0 ? mean(Total::kCriticNorm, updates) : kNone;
  stats.actor_q_mean = mean(Total::kActorQ, actor_updates);
  stats.actor_gradient_norm = mean(Total::kActorNorm, actor_updates);
  stats.policy_entropy_nats = mean(Total::kEntropy, actor_updates);
  stats.cost_critic_loss = mean(Total::kCostLoss, updates * num_cost_critics);
  stats.cost_q_mean = mean(Total::kCostQ, updates * num_cost_critics);
  sums_.zero_();
  updates_at_reading_ = num_updates_;
  actor_updates_at_reading_ = num_actor_updates_;
  return stats;
}

void Totals::SaveState(nn::TensorMap& tensors) const {
  const std::array counters = {num_updates_, num_actor_updates_, updates_at_reading_,
                               actor_updates_at_reading_};
  tensors["learner.counters"] = nn::StoredTensor::Of(std::span<const std::int64_t>(counters));
  const at::Tensor host = sums_.to(at::kCPU);
  tensors["learner.totals"] =
      nn::StoredTensor::Of(std::span<const double>(host.data_ptr<double>(), kNumTotals));
}

void Totals::LoadState(const nn::TensorFile& file) {
  std::array<std::int64_t, 4> counters;
  file.Read("learner.counters", std::span(counters));
  std::tie(num_updates_, num_actor_updates_, updates_at_reading_, actor_updates_at_reading_) =
      std::tuple(counters[0], counters[1], counters[2], counters[3]);
  at::Tensor host = at::zeros_like(sums_, at::kCPU);
  file.Read("learner.totals", std::span(host.data_ptr<double>(), kNumTotals));
  sums_.copy_(host);
}

}  // namespace slalom::learner
