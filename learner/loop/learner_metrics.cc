#include "learner/loop/learner_metrics.h"

#include "base/clock.h"
#include "metrics/catalogue.h"

namespace slalom::learner {

void DescribeLearning(const LearnerStats& learning, run::MetricsRow& row) {
  row.critic_loss = learning.critic_loss;
  row.mean_q = learning.q_mean;
  row.actor_q = learning.actor_q_mean;
  row.critic_gradient_norm = learning.critic_gradient_norm;
  row.actor_gradient_norm = learning.actor_gradient_norm;
  row.entropy = learning.entropy;
  row.temperature = learning.temperature;
  row.cost_q = learning.cost_q_mean;
  row.multiplier = learning.multiplier;
  row.violation = learning.violation;
  row.model_loss = learning.model.loss;
  row.model_error = learning.model.held_out_rmse;
  row.model_change = learning.model.held_out_change;
  row.model_likelihood = learning.model.held_out_likelihood;
  row.model_reward_error = learning.model.held_out_reward_rmse;
  row.model_termination = learning.model.held_out_termination;
  row.model_inside_50 = learning.model.inside_50;
  row.model_inside_90 = learning.model.inside_90;
}

LearnerMetrics::LearnerMetrics(metrics::Registry& registry)
    : registry_(registry),
      updates_(registry.counter(metrics::kUpdates)),
      update_seconds_(registry.histogram(metrics::kUpdateSeconds)) {
  registry_.counter(metrics::kCheckpoints);
  registry_.counter(metrics::kCheckpointFailures);
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
}

void LearnerMetrics::AddUpdate(double seconds) { update_seconds_.Observe(seconds); }

void LearnerMetrics::SetLearning(const run::MetricsRow& row) {
  updates_.RaiseTo(static_cast<double>(row.updates));
  if (row.updates_per_s == 0.0) return;
  registry_.gauge(metrics::kCriticLoss).Set(row.critic_loss);
  registry_.gauge(metrics::kQMean).Set(row.mean_q);
  registry_.gauge(metrics::kActorQMean).Set(row.actor_q);
  registry_.gauge(metrics::kCriticGradientNorm).Set(row.critic_gradient_norm);
  registry_.gauge(metrics::kActorGradientNorm).Set(row.actor_gradient_norm);
  registry_.gauge(metrics::kPolicyEntropy).Set(row.entropy);
  registry_.gauge(metrics::kTemperature).Set(row.temperature);
  registry_.gauge(metrics::kCostQMean).Set(row.cost_q);
  registry_.gauge(metrics::kConstraintMultiplier).Set(row.multiplier);
  registry_.gauge(metrics::kConstraintViolation).Set(row.violation);
  registry_.gauge(metrics::kModelLoss).Set(row.model_loss);
  registry_.gauge(metrics::kModelError).Set(row.model_error);
  registry_.gauge(metrics::kModelChange).Set(row.model_change);
  registry_.gauge(metrics::kModelStepsError).Set(row.model_steps_error);
  registry_.gauge(metrics::kModelLikelihood).Set(row.model_likelihood);
  registry_.gauge(metrics::kModelRewardError).Set(row.model_reward_error);
  registry_.gauge(metrics::kModelTermination).Set(row.model_termination);
  registry_.gauge(metrics::kModelCovered, {"0.5"}).Set(row.model_inside_50);
  registry_.gauge(metrics::kModelCovered, {"0.9"}).Set(row.model_inside_90);
}

void LearnerMetrics::AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates) {
  registry_.counter(metrics::kCheckpoints).Increment();
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
  registry_.gauge(metrics::kCheckpointSeconds).Set(seconds);
  registry_.gauge(metrics::kCheckpointBytes).Set(static_cast<double>(bytes));
  registry_.gauge(metrics::kCheckpointUpdates).Set(static_cast<double>(updates));
}

void LearnerMetrics::AddFailedCheckpoint() {
  registry_.counter(metrics::kCheckpointFailures).Increment();
}

void LearnerMetrics::SetFinished(bool finished) {
  registry_.gauge(metrics::kRunFinished).Set(finished ? 1.0 : 0.0);
}

}  // namespace slalom::learner
