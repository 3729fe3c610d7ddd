#include "learner/method.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::learner {

base::OneOf AlgorithmChoices() {
  base::OneOf names{};
  for (const AlgorithmTraits& algorithm : kAlgorithms) names.choices.push_back(algorithm.name);
  return names;
}

const AlgorithmTraits& TraitsOf(const LearnerConfig& config) {
  const auto found = std::ranges::find(kAlgorithms, config.algorithm, &AlgorithmTraits::name);
  SLALOM_CHECK(found != std::end(kAlgorithms));
  return *found;
}

policy::ActionDistribution DistributionOf(const LearnerConfig& config) {
  if (!TraitsOf(config).is_stochastic) return {};
  return {.kind = policy::DistributionKind::kGaussian,
          .log_std_min = config.log_std_min,
          .log_std_max = config.log_std_max};
}

policy::PlanningSpec PlanningOf(const MethodConfig& method, const nn::GoalRule& goal) {
  if (method.model.kind == nn::ModelKind::kNone) return {};
  policy::PlanningSpec planning{.model = method.model, .gamma = method.learner.gamma, .goal = goal};
  planning.model.ensemble = NumElites(method.model_training, method.model.ensemble);
  return planning;
}

int NumElites(const ModelTrainingConfig& config, int ensemble) {
  return config.elites > 0 ? config.elites : ensemble;
}

std::vector<replay::SampleSpec> SampleSpecs(const MethodConfig& method,
                                            const policy::PolicySpec& spec) {
  const LearnerConfig& config = method.learner;
  std::vector<replay::SampleSpec> specs = {{.batch = config.batch_size,
                                            .history = spec.network.history,
                                            .n_step = config.n_step,
                                            .gamma = config.gamma,
                                            .prioritized = config.prioritized,
                                            .importance_exponent = config.importance_exponent}};
  if (method.model.kind != nn::ModelKind::kNone) {
    const int num_starts = NumStartingStates(method.imagination, config.batch_size);
    specs.push_back(ModelSample(method.model_training, spec.network.history, num_starts));
  }
  return specs;
}

replay::SampleSpec ModelSample(const ModelTrainingConfig& config, int history, int num_rows) {
  return {.batch = std::max(num_rows, config.batch_size * config.updates_per_update),
          .history = history,
          .n_step = 1,
          .gamma = 1.0};
}

int NumStartingStates(const ImaginationConfig& config, int batch_size) {
  if (config.kind == ImaginationKind::kNone) return 0;
  return config.kind == ImaginationKind::kDyna ? config.imagined_batches * batch_size
                                               : config.rollouts;
}

std::int64_t NumReal(const ImaginationConfig& config, std::int64_t batch) {
  return std::lround(config.real_ratio * static_cast<double>(batch));
}

}  // namespace slalom::learner
