#include "app/cli/command_line.h"

#include <errno.h>

#include <cstdlib>

namespace slalom::cli {

std::string ShellWord(std::string_view text) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./:=,+@%";
  if (!text.empty() && text.find_first_not_of(kPlain) == std::string_view::npos) {
    return std::string(text);
  }
  std::string word = "'";
  for (const char c : text) {
    // A single quote cannot stand between single quotes.
    word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  }
  return word + "'";
}

std::string ProgramName() {
  const char* given = std::getenv("SLALOM_COMMAND");
  return given != nullptr && *given != '\0' ? given : program_invocation_name;
}

std::string CommandLine(const std::vector<std::string>& arguments) {
  std::string line = ShellWord(ProgramName());
  for (const std::string& argument : arguments) line += " " + ShellWord(argument);
  return line;
}

}  // namespace slalom::cli
