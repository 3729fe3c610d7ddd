#pragma once

#include <CLI/App.hpp>

namespace slalom::cli {

/// Adds `animate` to `slalom courses`: recorded drives as a moving picture.
void AddAnimateCommand(CLI::App& courses);

}  // namespace slalom::cli
