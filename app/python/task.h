#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "planners/guard/guard_config.h"
#include "sim/environment_config.h"

namespace slalom::python {

/// Keys as in a config file, and their values as TOML.
using Settings = std::vector<std::pair<std::string, std::string>>;

/// The keys of the task, which a file or keywords may set, and of a guard of what drives it.
struct Task {
  sim::EnvironmentConfig environment;
  planners::GuardConfig guard;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("environment", environment, "The task.");
    v.Section("guard", guard, "A check of each action before the robot gets it.");
  }
};

/// Lays settings over a task. Fields that are drawn for each episode come last, as a setting of
/// such a field takes it out of them.
inline void LaySettings(Settings settings, const config::FieldList& fields) {
  std::ranges::stable_partition(settings, [](const auto& setting) {
    return !setting.first.starts_with("environment.randomize");
  });
  for (const auto& [key, value] : settings) config::SetField(key, value, key, fields);
}

/// `task` under the files and the settings, each laid over the ones before.
inline Task TaskOf(Task task, const std::vector<std::string>& profiles, const Settings& settings) {
  const config::FieldList fields = config::ListFields(task);
  for (const std::string& file : profiles) config::ReadTomlFile(file, fields);
  LaySettings(settings, fields);
  return task;
}

/// Throws `base::Error` unless a pool can have so many threads.
inline void RequireThreads(int num_threads) {
  if (num_threads >= 1 && num_threads <= 256) return;
  throw base::Error(fmt::format("threads is {}, expected a number from 1 to 256", num_threads));
}

}  // namespace slalom::python
