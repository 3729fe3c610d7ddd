#include "app/train/profile.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "base/log.h"

namespace slalom::train {
namespace {

/// The keys that a profile may set: the task's and the guard's.
struct Profile {
  sim::EnvironmentConfig& environment;
  planners::GuardConfig& guard;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("environment", environment, "The robot, its sensor and the task.");
    v.Section("guard", guard, "A check of each action before the robot gets it.");
  }
};

}  // namespace

void LayProfile(const std::filesystem::path& file, sim::EnvironmentConfig& environment,
                planners::GuardConfig& guard) {
  Profile profile{environment, guard};
  AnyConfig others;
  std::vector<std::string> passed_over;
  try {
    passed_over =
        config::ReadSharedTomlFile(file, config::ListFields(profile), config::ListFields(others));
  } catch (const base::Error& error) {
    throw base::Error("{} (only [environment] and [guard] of a profile are used)", error.what());
  }
  if (passed_over.empty()) return;
  spdlog::info("{}: only [environment] and [guard] of a profile are used; ignored: {}",
               file.string(), fmt::join(passed_over, ", "));
}

}  // namespace slalom::train
