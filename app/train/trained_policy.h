#pragma once

#include <cstdint>
#include <filesystem>

#include "learner/run/run_settings.h"
#include "policy/nn/safetensors.h"

namespace slalom::train {

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

/// Whether a training that has come this far is at one of its limits.
bool IsAtLimit(const PolicyFigures& figures, const run::RunSettings& limits);

/// The figures in the metadata of a policy; 0 for one that it lacks.
PolicyFigures FiguresOf(const nn::Metadata& metadata);
/// Reads the figures that a policy file carries. Throws `base::Error` if the file is not a policy.
PolicyFigures ReadPolicyFigures(const std::filesystem::path& policy);

}  // namespace slalom::train
