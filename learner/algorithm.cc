#include "learner/algorithm.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/check.h"

namespace slalom::learner {

double PolicyAverageRate(const LearnerConfig& config, const Totals& totals) {
  if (config.average_rate == 0.0) return 0.0;
  const auto n = static_cast<double>(totals.num_actor_updates());
  return std::max(config.average_rate, 5.0 / (5.0 + n));
}

std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context) {
  using Make = std::unique_ptr<Algorithm> (*)(const AlgorithmContext&);
  static constexpr std::pair<std::string_view, Make> kMakers[] = {
      {"td3", MakeTd3},
      {"ddpg", MakeDdpg},
      {"sac", MakeSac},
      {"tqc", MakeTqc},
      {"distillation", MakeDistillation}};
  for (const auto& [name, make] : kMakers) {
    if (name == context.config.algorithm) return make(context);
  }
  base::CheckFailed(__FILE__, __LINE__, "an algorithm of kAlgorithms that nobody makes");
}

}  // namespace slalom::learner
