#pragma once

#include <vector>

#include "learner/learner_config.h"

namespace slalom::learner {

/// The names of all algorithms, so that a new algorithm is tested like any other.
inline std::vector<const char*> EveryAlgorithm() {
  std::vector<const char*> names;
  for (const AlgorithmTraits& entry : kAlgorithms) names.push_back(entry.name.data());
  return names;
}

}  // namespace slalom::learner
