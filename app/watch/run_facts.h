#pragma once

#include <filesystem>

#include "app/watch/run_progress.h"

namespace slalom::watch {

/// Returns the facts in the config of the run in `directory`. If it cannot be read, the one line
/// says why.
RunFacts FactsOf(const std::filesystem::path& directory);

}  // namespace slalom::watch
