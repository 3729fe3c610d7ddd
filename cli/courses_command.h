#pragma once

#include <CLI/App.hpp>
#include <string>

namespace slalom::cli {

/// Adds `courses` with its subcommands list, show, render, generate and import. They write what was
/// asked for to standard output or files, notes to standard error, and throw `base::Error` for what
/// the user can mend.
void AddCoursesCommand(CLI::App& app);

/// Throws `base::Error` where `--collection` names no directory, also if no set of it is asked for.
/// Empty: the built-in courses.
void RequireCollection(const std::string& directory);

}  // namespace slalom::cli
