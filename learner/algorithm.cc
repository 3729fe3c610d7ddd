#include "learner/algorithm.h"

#include <array>
#include <string_view>

#include "base/check.h"
#include "learner/ddpg.h"
#include "learner/sac.h"
#include "learner/td3.h"

namespace slalom::learner {
namespace {

template <class Method>
std::unique_ptr<Algorithm> Make(const AlgorithmContext& context) {
  return std::make_unique<Method>(context);
}

struct Entry {
  std::string_view name;  // The value of learner.algorithm.
  std::unique_ptr<Algorithm> (*make)(const AlgorithmContext& context);
  bool is_stochastic;  // Its policy draws actions from a Gaussian.
};

/// All algorithms.
constexpr std::array kRegistry = {
    Entry{"td3", Make<Td3>, false},
    Entry{"ddpg", Make<Ddpg>, false},
    Entry{"sac", Make<Sac>, true},
};

const Entry& Find(const LearnerConfig& config) {
  for (const Entry& entry : kRegistry) {
    if (entry.name == config.algorithm) return entry;
  }
  SLALOM_CHECK(false && "an algorithm that the config allows is not in the registry");
  return kRegistry.front();
}

}  // namespace

base::OneOf AlgorithmChoices() {
  base::OneOf names{};
  for (const Entry& entry : kRegistry) names.choices.push_back(entry.name);
  return names;
}

std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context) {
  return Find(context.config).make(context);
}

policy::ActionDistribution DistributionOf(const LearnerConfig& config) {
  if (!Find(config).is_stochastic) return {};
  return {.kind = "gaussian", .log_std_min = config.log_std_min, .log_std_max = config.log_std_max};
}

}  // namespace slalom::learner
