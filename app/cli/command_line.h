#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Commands that the program prints for its user to paste into a shell.

namespace slalom::cli {

/// The text as one word of a POSIX shell, in single quotes if it needs them.
std::string ShellWord(std::string_view text);

/// The name by which the user called this program: the environment's SLALOM_COMMAND, which the
/// script `slalom` sets to its own path, else the path of this process.
std::string ProgramName();

/// `ProgramName()` and the arguments as a line for a shell. It works from the directory in which
/// the program was called, provided that the paths among the arguments do.
std::string CommandLine(const std::vector<std::string>& arguments);

}  // namespace slalom::cli
