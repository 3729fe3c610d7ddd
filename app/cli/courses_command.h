#pragma once

#include <CLI/App.hpp>

namespace slalom::cli {

/// Adds `courses` with its subcommands list, show, render, animate, generate and import. They write
/// results to standard output or files and notes to standard error, and throw `base::Error` for
/// mistakes that the user can correct.
void AddCoursesCommand(CLI::App& app);

}  // namespace slalom::cli
