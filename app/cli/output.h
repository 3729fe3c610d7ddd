#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

/// Rules for the files that `--output` may replace. A command checks them before it starts to work,
/// so that nobody waits for output that then cannot be written.

namespace slalom::cli {

/// The help text of every `--force`.
inline constexpr char kForceHelp[] = "Replace files that exist, whatever made them";

/// Throws `base::Error` that names `path` unless a command may write this file. For a new file, the
/// directory must exist and be writable. A file that exists must be writable and, unless `force` is
/// given, not be a regular file; pipes, devices and /dev/stdout are written to, not replaced.
void RequireOutputFile(const std::filesystem::path& path, bool force);

/// How a command recognises its own output.
struct OwnOutput {
  std::string_view command;                         ///< "slalom evaluate".
  std::initializer_list<std::string_view> markers;  ///< Its output has one or more of these files.
};

/// Throws `base::Error` that names `path` unless a command may write its files into this directory.
/// It must be possible to make the directory or to write to it. Unless `force` is given, it must
/// also hold no file, or hold one of the markers and not be the directory of a training run.
/// Directories in it do not matter, because they cannot be replaced. Makes nothing.
void RequireOutputDirectory(const std::filesystem::path& path, const OwnOutput& own, bool force);

/// A page and its tables.
struct PageFiles {
  std::string html;
  std::string markdown;
  std::string csv;
};

/// Writes the files to `directory`, which is made if it is missing, under `name` with the endings
/// html, md and csv, and prints where they are. Throws `base::Error` if one cannot be written.
void WritePage(const std::filesystem::path& directory, std::string_view name,
               const PageFiles& files);

}  // namespace slalom::cli
