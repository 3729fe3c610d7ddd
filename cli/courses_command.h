#pragma once

#include <CLI/App.hpp>

namespace slalom::cli {

/// Adds `courses` with its subcommands list, show, render, animate, generate and import. They write
/// what was asked for to standard output or files, notes to standard error, and throw `base::Error`
/// for what the user can mend.
void AddCoursesCommand(CLI::App& app);

}  // namespace slalom::cli
