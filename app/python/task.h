#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/config.h"
#include "sim/environment_config.h"

namespace slalom::python {

/// Keys as in a config file, and their values as TOML.
using Settings = std::vector<std::pair<std::string, std::string>>;

/// The keys of the task, which a file or keywords may set.
struct Task {
  sim::EnvironmentConfig environment;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("environment", environment, "The task.");
  }
};

/// The task by the defaults, `trained`, the files and the settings, each laid over the ones before.
inline sim::EnvironmentConfig TaskOf(const Settings& trained,
                                     const std::vector<std::string>& profiles,
                                     const Settings& settings) {
  Task task;
  const config::FieldList fields = config::ListFields(task);
  for (const auto& [key, value] : trained) config::SetField(key, value, key, fields);
  for (const std::string& file : profiles) config::ReadTomlFile(file, fields);
  for (const auto& [key, value] : settings) config::SetField(key, value, key, fields);
  return task.environment;
}

}  // namespace slalom::python
