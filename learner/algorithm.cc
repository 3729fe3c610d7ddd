#include "learner/algorithm.h"

#include <string_view>
#include <utility>

#include "base/check.h"

namespace slalom::learner {

std::unique_ptr<Algorithm> MakeAlgorithm(const AlgorithmContext& context) {
  using Make = std::unique_ptr<Algorithm> (*)(const AlgorithmContext&);
  static constexpr std::pair<std::string_view, Make> kMakers[] = {
      {"td3", MakeTd3}, {"ddpg", MakeDdpg}, {"sac", MakeSac}, {"tqc", MakeTqc}};
  for (const auto& [name, make] : kMakers) {
    if (name == context.config.algorithm) return make(context);
  }
  base::CheckFailed(__FILE__, __LINE__, "an algorithm of kAlgorithms that nobody makes");
}

}  // namespace slalom::learner
