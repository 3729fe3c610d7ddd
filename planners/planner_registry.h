#pragma once

#include <memory>
#include <string>
#include <vector>

#include "planners/dwa/dwa_config.h"
#include "planners/elastic_band/elastic_band_config.h"
#include "planners/mppi/mppi_config.h"
#include "planners/navigation/local_planner.h"
#include "planners/navigation/navigation_config.h"
#include "planners/teb/teb_config.h"

namespace slalom::planners {

/// Settings of all classical systems: the navigation that they share, and each local planner with
/// its own settings of navigation. It is also the list of planners: the registry knows each section
/// whose config has a `MakePlanner` by the section's name.
struct PlannersConfig {
  NavigationConfig navigation;
  DwaConfig dwa;
  ElasticBandConfig eband;
  TebConfig teb;
  MppiConfig mppi;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("navigation", navigation, "Costmaps, global planner, recoveries.");
    v.Section("dwa", dwa, "Dynamic window approach.");
    v.Section("eband", eband, "Elastic band.");
    v.Section("teb", teb, "Timed elastic bands.");
    v.Section("mppi", mppi, "Model predictive path integral control.");
  }
};

/// Returns the names of all planners.
std::vector<std::string> PlannerNames();

/// Throws `base::Error`, with a list of all names, if there is no planner of this name.
std::unique_ptr<LocalPlanner> MakeLocalPlanner(const std::string& name,
                                               const PlannersConfig& config);

/// Returns a planner's own settings of navigation. Throws like `MakeLocalPlanner`.
PlannerNavigationConfig NavigationOf(const std::string& name, const PlannersConfig& config);

}  // namespace slalom::planners
