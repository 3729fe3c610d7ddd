#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "app/watch/run_progress.h"

/// The page of a run: its state, curves, scores and settings.

namespace slalom::watch {

/// Returns name, state, stage, steps, success rate and age of a run.
nlohmann::json SummaryJson(const RunProgress& run);

/// Returns `SummaryJson` with the run's curves (metrics.csv), its scores (curve.csv) and facts.
nlohmann::json RunJson(const RunProgress& run, const RunFacts& facts);

/// Returns the page that asks the server for its data.
std::string LivePage();

/// Returns the page of the run in `directory` as it is now, with everything in it, which opens
/// without a network. Throws `base::Error` if there is no run.
std::string RunPage(const std::filesystem::path& directory, const RunFacts& facts);

}  // namespace slalom::watch
