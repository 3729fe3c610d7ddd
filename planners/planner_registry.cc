#include "planners/planner_registry.h"

#include <fmt/format.h>

#include "base/error.h"
#include "planners/dwa/dwa.h"
#include "planners/elastic_band/elastic_band_planner.h"
#include "planners/mppi/mppi.h"
#include "planners/teb/teb.h"

namespace slalom::planners {
namespace {

struct Entry {
  const char* name;
  std::unique_ptr<LocalPlanner> (*make)(const PlannersConfig&);
  const PlannerNavigationConfig& (*navigation)(const PlannersConfig&);
};

constexpr Entry kEntries[] = {
    {"dwa",
     [](const PlannersConfig& c) -> std::unique_ptr<LocalPlanner> {
       return std::make_unique<DwaPlanner>(c.dwa, c.navigation.footprint);
     },
     [](const PlannersConfig& c) -> const PlannerNavigationConfig& { return c.dwa.navigation; }},
    {"eband",
     [](const PlannersConfig& c) -> std::unique_ptr<LocalPlanner> {
       return std::make_unique<ElasticBandPlanner>(c.eband);
     },
     [](const PlannersConfig& c) -> const PlannerNavigationConfig& { return c.eband.navigation; }},
    {"teb",
     [](const PlannersConfig& c) -> std::unique_ptr<LocalPlanner> {
       return std::make_unique<TebPlanner>(c.teb);
     },
     [](const PlannersConfig& c) -> const PlannerNavigationConfig& { return c.teb.navigation; }},
    {"mppi",
     [](const PlannersConfig& c) -> std::unique_ptr<LocalPlanner> {
       return std::make_unique<MppiPlanner>(c.mppi);
     },
     [](const PlannersConfig& c) -> const PlannerNavigationConfig& { return c.mppi.navigation; }},
};

const Entry& Find(const std::string& name) {
  std::string names;
  for (const Entry& entry : kEntries) {
    if (name == entry.name) return entry;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", entry.name);
  }
  throw base::Error(fmt::format("there is no planner '{}'; there are: {}", name, names));
}

}  // namespace

std::vector<std::string> PlannerNames() {
  std::vector<std::string> names;
  for (const Entry& entry : kEntries) names.emplace_back(entry.name);
  return names;
}

std::unique_ptr<LocalPlanner> MakeLocalPlanner(const std::string& name,
                                               const PlannersConfig& config) {
  return Find(name).make(config);
}

const PlannerNavigationConfig& NavigationOf(const std::string& name, const PlannersConfig& config) {
  return Find(name).navigation(config);
}

}  // namespace slalom::planners
