#pragma once

#include <filesystem>
#include <initializer_list>
#include <string_view>

/// What `--output` may replace. Asked before a command's work, so that nobody waits for what then
/// cannot be written.

namespace slalom::cli {

/// The help text of every `--force`.
inline constexpr char kForceHelp[] = "Replace what is there, whoever made it";

/// Throws `base::Error` that names `path` unless a command may write this file: its directory is
/// there and may be written to, and it is new, or no regular file (a pipe, a device, /dev/stdout,
/// which are written to and not replaced), or `force` is given.
void RequireOutputFile(const std::filesystem::path& path, bool force);

/// By what a command knows its own output again.
struct OwnOutput {
  std::string_view command;                         ///< "slalom evaluate".
  std::initializer_list<std::string_view> markers;  ///< Files, of which its output has one or more.
};

/// Throws `base::Error` that names `path` unless a command may write its files into this directory:
/// it can be made or written to, and it holds no file, or it has one of the markers and is not the
/// directory of a training run, or `force` is given. Directories in it do not matter, as they
/// cannot be replaced. Makes nothing.
void RequireOutputDirectory(const std::filesystem::path& path, const OwnOutput& own, bool force);

}  // namespace slalom::cli
