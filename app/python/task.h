#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/config.h"
#include "sim/environment_config.h"

namespace slalom::python {

/// Keys as in a config file, and their values as TOML.
using Settings = std::vector<std::pair<std::string, std::string>>;

/// What a file or keywords may set: the keys of the task.
struct Task {
  sim::EnvironmentConfig environment;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("environment", environment, "The task.");
  }
};

/// The defaults, under those of `trained`, under the files, under the settings.
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
