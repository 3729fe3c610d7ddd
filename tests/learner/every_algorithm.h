#pragma once

#include <vector>

#include "learner/learner_config.h"

namespace slalom::learner {

/// The names of all algorithms that learn from rewards, so that a new one is tested like any other.
inline std::vector<const char*> EveryAlgorithm() {
  std::vector<const char*> names;
  for (const AlgorithmTraits& entry : kAlgorithms) {
    if (!entry.is_taught) names.push_back(entry.name.data());
  }
  return names;
}

}  // namespace slalom::learner
