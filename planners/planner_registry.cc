#include "planners/planner_registry.h"

#include <fmt/format.h>

#include <functional>
#include <utility>

#include "base/error.h"

namespace slalom::planners {
namespace {

struct Entry {
  std::string name;
  PlannerNavigationConfig navigation;
  std::function<std::unique_ptr<LocalPlanner>()> make;
};

/// Visits `PlannersConfig` and collects the sections that a planner can be made of.
struct EntryVisitor {
  const NavigationConfig& navigation;
  std::vector<Entry> entries;

  template <class Config>
  void Section(const char* name, const Config& config, const char*) {
    if constexpr (requires { MakePlanner(config, navigation); }) {
      entries.push_back({name, config.navigation,
                         [config, shared = navigation] { return MakePlanner(config, shared); }});
    }
  }
};

std::vector<Entry> Entries(PlannersConfig config) {
  EntryVisitor visitor{config.navigation, {}};
  config.Visit(visitor);
  return std::move(visitor.entries);
}

Entry Find(const std::string& name, const PlannersConfig& config) {
  std::string names;
  for (Entry& entry : Entries(config)) {
    if (name == entry.name) return std::move(entry);
    names += fmt::format("{}{}", names.empty() ? "" : ", ", entry.name);
  }
  throw base::Error("there is no planner '{}'; there are: {}", name, names);
}

}  // namespace

std::vector<std::string> PlannerNames() {
  std::vector<std::string> names;
  for (Entry& entry : Entries({})) names.push_back(std::move(entry.name));
  return names;
}

std::unique_ptr<LocalPlanner> MakeLocalPlanner(const std::string& name,
                                               const PlannersConfig& config) {
  return Find(name, config).make();
}

PlannerNavigationConfig NavigationOf(const std::string& name, const PlannersConfig& config) {
  return Find(name, config).navigation;
}

}  // namespace slalom::planners
