#pragma once

#include <cstdint>
#include <filesystem>

namespace slalom::sweep {

/// The extent of the training behind a policy. A value.
struct PolicyFigures {
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  double training_s = 0.0;  ///< Time spent training, [s].

  PolicyFigures& operator+=(const PolicyFigures& other) {
    steps += other.steps;
    updates += other.updates;
    training_s += other.training_s;
    return *this;
  }
};

/// Reads the figures that a policy file carries; 0 for one that it lacks. Throws `base::Error` if
/// the file is not a policy.
PolicyFigures ReadPolicyFigures(const std::filesystem::path& policy);

}  // namespace slalom::sweep
