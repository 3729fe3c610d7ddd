#pragma once

#include <vector>

#include "learner/learner_config.h"

namespace slalom::learner {

/// The names of the registry, so that a new algorithm is tested like any other.
inline std::vector<const char*> EveryAlgorithm() {
  std::vector<const char*> names;
  for (const AlgorithmEntry& entry : kAlgorithms) names.push_back(entry.name.data());
  return names;
}

}  // namespace slalom::learner
