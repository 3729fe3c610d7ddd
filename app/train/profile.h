#pragma once

#include <filesystem>

#include "app/train/run_config.h"
#include "planners/guard/guard_config.h"
#include "planners/planner_registry.h"
#include "sim/environment_config.h"

namespace slalom::train {

/// Every key that any TOML file of this program may hold, except the keys of a sweep's plan.
struct AnyConfig {
  RunConfig run;
  planners::PlannersConfig planners;

  template <class Visitor>
  void Visit(Visitor& v) {
    run.Visit(v);
    planners.Visit(v);
  }
};

/// Lays [environment] and [guard] of the TOML file over these. Other keys are checked, then
/// ignored, and a line on standard error names them. Throws `base::Error` like
/// `config::ReadTomlFile`.
void LayProfile(const std::filesystem::path& file, sim::EnvironmentConfig& environment,
                planners::GuardConfig& guard);

}  // namespace slalom::train
