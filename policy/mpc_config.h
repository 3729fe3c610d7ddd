#pragma once

#include <cstdint>

#include "base/config_field.h"

namespace slalom::policy {

/// How the sampled action sequences make a plan.
enum class PlanUpdate { kMppi, kCem, kSample };
inline base::OneOf EnumNames(PlanUpdate) { return {"mppi", "cem", "sample"}; }

/// How an agent plans. The defaults are from the paper's experiments (docs/original-system.md,
/// section 5.2), without the faults of its code.
struct MpcConfig {
  bool enabled = false;
  int horizon = 5;
  int samples = 256;
  int iterations = 1;
  double noise = 0.1;
  PlanUpdate update = PlanUpdate::kMppi;
  double temperature = 0.1;
  double elite_fraction = 0.1;
  bool model_noise = false;
  std::int64_t learning_starts = 1000;
  bool no_planning = false;
  bool unscaled_action = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("enabled", enabled,
      "Actors, evaluations and `slalom evaluate` plan with the policy's transition model.");
    v("horizon", horizon, base::Range{1, 100}, "steps", "Steps that a plan looks ahead.");
    v("samples", samples, base::Range{1, 100000}, "",
      "Action sequences sampled per plan and iteration.");
    v("iterations", iterations, base::Range{1, 100}, "",
      "Rounds of sampling; those after the first sample around the plan so far.");
    v("noise", noise, base::Range{0.0, 10.0}, "",
      "Standard deviation of the noise on the policy's normalised actions.");
    v("update", update,
      "How the samples make a plan. mppi: their mean, weighted by the exponential of the return. "
      "cem: mean and standard deviation of the best. sample: one of them, drawn with mppi's "
      "weights, as published.");
    v("temperature", temperature, base::Range{1e-9, 1e9}, "",
      "A sequence whose return is higher by this, in the learner's scaled rewards, weighs e times "
      "as much.",
      base::ReadIf{"update", {"mppi", "sample"}});
    v("elite_fraction", elite_fraction, base::Range{1e-6, 1.0}, "",
      "Fraction of the samples that counts as the best.", base::ReadIf{"update", {"cem"}});
    v("model_noise", model_noise,
      "Sample a probabilistic model's frames instead of taking their means, as published.",
      base::ReadIf{"model.kind", {"probabilistic"}});
    v("learning_starts", learning_starts, base::Range{0, 1e12}, "updates",
      "Updates of the policy before planning starts; until then the policy drives by itself.");
    v("no_planning", no_planning,
      "Reproduce the original's fault M1: all sequences weigh the same, so that the policy drives "
      "with noise instead of a plan.");
    v("unscaled_action", unscaled_action,
      "Reproduce the original's fault M2: normalised actions are taken for actions in [m/s] and "
      "[rad/s].");
  }
};

}  // namespace slalom::policy
