#include "learner/method_rules.h"

#include "base/error.h"

namespace slalom::learner {
namespace {

void RequireConsistent(const LearnerConfig& config) {
  base::ThrowIf(config.log_std_min > config.log_std_max,
                "learner.log_std_min is {}, expected at most learner.log_std_max = {}",
                config.log_std_min, config.log_std_max);
  base::ThrowIf(config.dropped_quantiles >= config.quantiles,
                "learner.dropped_quantiles is {}, expected less than learner.quantiles = {}",
                config.dropped_quantiles, config.quantiles);
}

/// Throws if the algorithm cannot use another section.
void RequireFit(const MethodConfig& method) {
  const LearnerConfig& learner = method.learner;
  const bool has_model = method.model.kind != nn::ModelKind::kNone;
  if (TraitsOf(learner).is_taught) {
    const char* const unfit = method.constraint.kind != ConstraintKind::kNone ? "constraint.kind"
                              : has_model                                     ? "model.kind"
                                                                              : nullptr;
    base::ThrowIf(
        unfit != nullptr,
        "{} is set, expected its default with learner.algorithm = \"{}\", which learns from "
        "teachers alone",
        unfit, learner.algorithm);
  }
  base::ThrowIf(
      learner.algorithm == "tqc" && has_model,
      "learner.algorithm is \"tqc\", expected another with a transition model (model.kind): "
      "planning needs critics that give one value, not quantiles");
}

void RequireConsistent(const ConstraintConfig& config) {
  const bool rises = config.kind == ConstraintKind::kLagrangian;
  base::ThrowIf(rises && config.learning_rate == 0.0 && config.proportional_gain == 0.0 &&
                    config.derivative_gain == 0.0,
                "constraint.learning_rate and both gains are 0, expected one of them above 0 with "
                "constraint.kind = \"lagrangian\": the multiplier would never move");
  base::ThrowIf(
      rises && config.multiplier_max == 0.0,
      "constraint.multiplier_max is 0, expected more: with a multiplier of 0 the constraint has "
      "no effect");
  base::ThrowIf(
      config.kind == ConstraintKind::kFixed && config.multiplier == 0.0,
      "constraint.multiplier is 0, expected more with constraint.kind = \"fixed\": with a "
      "multiplier of 0 the constraint has no effect");
  base::ThrowIf(rises && config.multiplier > config.multiplier_max,
                "constraint.multiplier is {}, expected at most constraint.multiplier_max = {}",
                config.multiplier, config.multiplier_max);
}

void RequireConsistent(const ModelTrainingConfig& config, int ensemble) {
  base::ThrowIf(config.elites > ensemble,
                "model_training.elites is {}, expected at most model.ensemble = {}", config.elites,
                ensemble);
  base::ThrowIf(
      config.elites > 0 && config.held_out == 0.0,
      "model_training.elites is {}, expected model_training.held_out above 0: elites are chosen "
      "by their error on held-out transitions",
      config.elites);
}

/// Throws if MBPO's rollouts do not go with batches of this size, or with each other.
void RequireConsistentMbpo(const ImaginationConfig& config, int batch_size) {
  base::ThrowIf(
      NumReal(config, batch_size) == batch_size,
      "imagination.real_ratio is {}, expected less with imagination.kind = \"mbpo\": a batch of "
      "{} would have no imagined transitions",
      config.real_ratio, batch_size);
  base::ThrowIf(config.rollouts % batch_size != 0,
                "imagination.rollouts is {}, expected a multiple of learner.batch_size = {}",
                config.rollouts, batch_size);
  base::ThrowIf(config.buffer_capacity < batch_size,
                "imagination.buffer_capacity is {}, expected at least learner.batch_size = {}",
                config.buffer_capacity, batch_size);
  base::ThrowIf(
      config.final_rollout_steps != 0 && config.final_rollout_steps < config.rollout_steps,
      "imagination.final_rollout_steps is {}, expected 0 or at least imagination.rollout_steps = "
      "{}",
      config.final_rollout_steps, config.rollout_steps);
  base::ThrowIf(config.schedule_end < config.schedule_begin,
                "imagination.schedule_end is {}, expected at least schedule_begin = {}",
                config.schedule_end, config.schedule_begin);
}

void RequireImaginable(const MethodConfig& method) {
  const ImaginationConfig& config = method.imagination;
  const std::string_view kind = base::EnumName(config.kind);
  if (config.kind == ImaginationKind::kNone) return;
  base::ThrowIf(
      method.model.kind == nn::ModelKind::kNone,
      "imagination.kind is \"{}\", expected model.kind = \"deterministic\" or \"probabilistic\": "
      "imagination needs a transition model",
      kind);
  base::ThrowIf(
      method.constraint.kind != ConstraintKind::kNone,
      "imagination.kind is \"{}\", expected \"none\" with constraint.kind = \"{}\": a transition "
      "model predicts no cost",
      kind, base::EnumName(method.constraint.kind));
  base::ThrowIf(method.learner.prioritized,
                "imagination.kind is \"{}\", expected \"none\" with learner.prioritized: imagined "
                "transitions have no priority",
                kind);
  base::ThrowIf(
      config.imagined_batches == 0,
      "imagination.imagined_batches is 0, expected at least 1 with imagination.kind = \"{}\": "
      "nothing would be learned from imagined transitions",
      kind);
  if (config.kind == ImaginationKind::kMbpo) {
    RequireConsistentMbpo(config, method.learner.batch_size);
  }
}

}  // namespace

void RequireConsistent(const MethodConfig& method) {
  RequireConsistent(method.learner);
  RequireFit(method);
  RequireConsistent(method.constraint);
  RequireConsistent(method.model_training, method.model.ensemble);
  RequireImaginable(method);
}

}  // namespace slalom::learner
