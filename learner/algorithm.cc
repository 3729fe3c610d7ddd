#include "learner/algorithm.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/check.h"

namespace slalom::learner {

nn::NetworkShape CriticShape(const LearnerConfig& config, const policy::PolicySpec& spec,
                             int num_outputs) {
  if (!config.privileged_critic) return spec.critic_shape(num_outputs);
  const nn::NetworkConfig heads{.encoder_layers = {},
                                .head_layers = spec.network.head_layers,
                                .layer_norm = spec.network.layer_norm};
  const int frame_size = nn::FeatureMap(spec.observation, spec.network).frame_size();
  return nn::CriticShape(heads, frame_size + env::kPrivilegedSize, num_outputs, spec.action_size);
}

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
