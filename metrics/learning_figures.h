#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "metrics/registry.h"

namespace slalom::metrics {

/// Figures of a transition model: means over its updates since the last reading. A figure is NaN if
/// there is no model, nothing was held out, or this kind of model does not have it.
struct ModelFigures {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::int64_t num_updates = 0;  ///< Updates of each ensemble member. Not shown.
  double loss = kNone;
  double gradient_norm = kNone;
  double error = kNone;
  double change = kNone;
  double likelihood_nats = kNone;
  double reward_error = kNone;
  double termination_nats = kNone;
  double inside_50 = kNone;
  double inside_90 = kNone;
  double steps_error = kNone;
};

/// Figures of a learner: means over the updates since the last reading, unless `Visit` says
/// otherwise. A figure is NaN if the method does not have it, or there was no update.
///
/// `Visit` lists each figure once. The same name stands for it everywhere: it is a column of
/// metrics.csv, the scalar "training/NAME" of TensorBoard, and Prometheus' gauge slalom_NAME.
struct LearningFigures {
  static constexpr double kNone = ModelFigures::kNone;
  double critic_loss = kNone;
  double q_mean = kNone;
  double actor_q_mean = kNone;
  double critic_gradient_norm = kNone;
  double actor_gradient_norm = kNone;
  double actor_learning_rate = kNone;
  double critic_learning_rate = kNone;
  double policy_entropy_nats = kNone;
  double temperature = kNone;
  double cost_q_mean = kNone;
  double cost_critic_loss = kNone;
  double constraint_multiplier = kNone;
  double constraint_violation = kNone;
  double imagined_transitions = 0.0;
  ModelFigures model;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("critic_loss", critic_loss, "Mean squared temporal-difference error of one critic.");
    v("q_mean", q_mean, "Mean value of replayed actions, in scaled rewards.");
    v("actor_q_mean", actor_q_mean,
      "Mean value of the actor's own actions, which it maximises, in scaled rewards. Distillation: "
      "minus their mean squared distance from the teachers' actions.");
    v("critic_gradient_norm", critic_gradient_norm, "Norm of the critics' gradient.");
    v("actor_gradient_norm", actor_gradient_norm, "Norm of the actor's gradient.");
    v("actor_learning_rate", actor_learning_rate,
      "Learning rate of the actor now (learner.final_learning_rate_fraction).");
    v("critic_learning_rate", critic_learning_rate,
      "Learning rate of the critics now. NaN without critics.");
    v("policy_entropy_nats", policy_entropy_nats, "Entropy of the policy (SAC). NaN without one.");
    v("temperature", temperature, "Weight of the entropy now (SAC). NaN without one.");
    v("cost_q_mean", cost_q_mean,
      "Mean value of the cost critics, in discounted cost. NaN without a constraint, as for "
      "the next three.");
    v("cost_critic_loss", cost_critic_loss,
      "Mean squared temporal-difference error of one cost critic.");
    v("constraint_multiplier", constraint_multiplier,
      "Lagrange multiplier of the constraint, now.");
    v("constraint_violation", constraint_violation,
      "Cost per training episode above the constraint's limit, when last observed.");
    v("imagined_transitions", imagined_transitions,
      "Transitions that the model imagined for the policy to learn from, since the "
      "beginning. 0 without imagination.");
    v("model_loss", model.loss,
      "Training loss of the transition model, mean over its members. NaN without a model, as for "
      "all its metrics.");
    v("model_gradient_norm", model.gradient_norm, "Norm of the model's gradient.");
    v("model_error", model.error,
      "Root mean squared error of the model per number of the next frame, on held-out "
      "transitions.");
    v("model_change", model.change,
      "The same error of predicting no change. A useful model's error is smaller.");
    v("model_likelihood_nats", model.likelihood_nats,
      "Negative log-likelihood per number of the next frame, on held-out transitions. "
      "Probabilistic models only, as for the intervals.");
    v("model_reward_error", model.reward_error,
      "Root mean squared error of the predicted scaled reward, on held-out transitions.");
    v("model_termination_nats", model.termination_nats,
      "Cross-entropy of the predicted termination, on held-out transitions.");
    v("model_inside_50", model.inside_50,
      "Share of held-out numbers inside the central interval of the prediction that should hold "
      "50 % of them.");
    v("model_inside_90", model.inside_90, "The same of 90 %.");
    v("model_steps_error", model.steps_error,
      "The model's error per number five steps ahead, given the actions taken, on replayed "
      "transitions.");
  }
};

/// The gauges of the figures, in the order of `Visit`.
std::span<const Spec> LearningSpecs();

/// Shows the figures.
void ShowLearning(LearningFigures figures, Registry& registry);

}  // namespace slalom::metrics
