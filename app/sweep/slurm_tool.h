#pragma once

#include <string>
#include <vector>

namespace slalom::sweep {

/// What a command of Slurm said.
struct ToolAnswer {
  bool is_installed = true;  ///< false: there is no such program on the PATH.
  int exit_code = 0;         ///< 128 + the signal's number where one ended it.
  std::string output;
  std::string errors;
};

/// Runs a program that is looked for on the PATH, without input, and waits for its end. Throws
/// `base::Error` if it cannot be started for another reason than that it is not there.
ToolAnswer RunTool(const std::vector<std::string>& arguments);

}  // namespace slalom::sweep
