#include "learner/algorithm.h"

#include "base/check.h"

namespace slalom::learner {

base::OneOf AlgorithmChoices() {
  base::OneOf names{};
  for (const AlgorithmEntry& entry : kAlgorithms) names.choices.push_back(entry.name);
  return names;
}

const AlgorithmEntry& AlgorithmOf(const LearnerConfig& config) {
  for (const AlgorithmEntry& entry : kAlgorithms) {
    if (entry.name == config.algorithm) return entry;
  }
  SLALOM_CHECK(false && "an algorithm that the config allows is not in the registry");
  return kAlgorithms[0];
}

std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context) {
  return AlgorithmOf(context.config).make(context);
}

policy::ActionDistribution DistributionOf(const LearnerConfig& config) {
  if (!AlgorithmOf(config).is_stochastic) return {};
  return {.kind = policy::DistributionKind::kGaussian,
          .log_std_min = config.log_std_min,
          .log_std_max = config.log_std_max};
}

}  // namespace slalom::learner
