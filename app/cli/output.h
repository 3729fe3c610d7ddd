#pragma once

#include <filesystem>

#include "app/train/scoring.h"

/// The rule for output that exists: it is refused, and --force replaces it. A command checks this
/// before it starts to work, so that nobody waits for output that then cannot be written.

namespace slalom::cli {

/// The help text of every `--force`.
inline constexpr char kForceHelp[] = "Replace output that exists";

/// Throws `base::Error` that names `path` unless a command may write this file. For a new file, the
/// directory must exist and be writable. A file that exists must be writable and, unless `force` is
/// given, not be a regular file; pipes, devices and /dev/stdout are written to, not replaced.
void RequireOutputFile(const std::filesystem::path& path, bool force);

/// Throws `base::Error` that names `path` unless a command may write its files into this directory.
/// It must be possible to make the directory or to write to it and, unless `force` is given, it
/// must hold no file. Directories in it do not matter, because they cannot be replaced. Makes
/// nothing.
void RequireOutputDirectory(const std::filesystem::path& path, bool force);

/// Writes the reports, the trajectories and a picture of the courses with them (courses.png,
/// courses.svg) into `directory`. Throws `base::Error` if that fails.
void WriteScores(const train::Scores& scores, const std::filesystem::path& directory);

}  // namespace slalom::cli
