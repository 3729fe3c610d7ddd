#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/cli/commands.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/log.h"
#include "base/machine.h"
#include "base/name.h"
#include "base/version.h"
#include "policy/nn/kernels/blas.h"
#include "policy/nn/kernels/blas_kernel.h"

namespace {

constexpr char kFooter[] =
    "First run:   slalom train configs/quickstart.toml      a policy that drives, in a minute or "
    "two\n"
    "Then:        slalom evaluate --policy runs/quickstart/policy.safetensors --courses "
    "static-test\n"
    "             slalom courses render --courses static-test --output courses.png\n"
    "Settings:    slalom config print configs/fast.toml, docs/config.md\n"
    "Manual:      docs/tutorial.md to begin with, docs/README.md for everything else";

/// The commands below `parent`, or its groups of options, which CLI11 takes for commands without a
/// name.
std::vector<const CLI::App*> Below(const CLI::App& parent, bool groups) {
  return parent.get_subcommands(
      [groups](const CLI::App* child) { return child->get_name().empty() == groups; });
}

/// The command that the first words name.
struct NamedCommand {
  const CLI::App* command = nullptr;
  std::string path;     ///< "slalom courses render".
  std::string mistake;  ///< Why the words name no command; else empty.
};

/// CLI11 would say of a mistyped command that a command is missing.
NamedCommand FindCommand(const CLI::App& app, std::span<char* const> words) {
  NamedCommand named{&app, "slalom", ""};
  for (const char* word : words) {
    const auto commands = Below(*named.command, false);
    if (commands.empty() || word[0] == '-') break;
    const auto it = std::ranges::find_if(
        commands, [&](const CLI::App* command) { return command->check_name(word); });
    if (it == commands.end()) {
      std::vector<std::string> names;
      names.reserve(commands.size());
      for (const CLI::App* command : commands) names.push_back(command->get_name());
      const std::string suggestion = slalom::base::Suggestion(word, names);
      named.mistake = fmt::format(
          "no command '{} {}'{}", named.path, word,
          suggestion.empty() ? fmt::format("; {} --help lists them", named.path) : suggestion);
      break;
    }
    named.command = *it;
    named.path += fmt::format(" {}", word);
  }
  return named;
}

/// "slalom: no option '--corses' of 'slalom evaluate'; did you mean '--courses'?" on a line for
/// each option that the command does not have: CLI11 would only say that --courses is missing.
std::string UnknownOptions(const NamedCommand& named, std::span<char* const> words) {
  std::vector<std::string> names = {"--help"};
  std::vector<const CLI::App*> holders = Below(*named.command, true);
  holders.push_back(named.command);
  for (const CLI::App* holder : holders) {
    for (const CLI::Option* option : holder->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  std::string text;
  for (const std::string_view word : words) {
    const std::string name(word.substr(0, word.find('=')));
    if (!name.starts_with("--") || name == "--" || std::ranges::count(names, name) > 0) continue;
    text += fmt::format("slalom: no option '{}' of '{}'{}\n", name, named.path,
                        slalom::base::Suggestion(name, names));
  }
  return text;
}

/// Why a word is empty that has to say something, or "". An unset variable leaves `--name=`, for
/// which CLI11 would take the next word.
std::string EmptyValue(std::span<char* const> words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string_view word = words[i];
    if (word.starts_with("--") && word.size() > 2 && word.find('=') == word.size() - 1) {
      return fmt::format("{} has no value; expected one after the '='", word);
    }
    if (!word.empty()) continue;
    const std::string_view before = i > 0 ? words[i - 1] : "";
    return before.starts_with('-')
               ? fmt::format("{} has an empty value; expected one that is not", before)
               : fmt::format("argument {} is empty; expected none or one that is not", i + 1);
  }
  return "";
}

/// Whether all that was printed has arrived; a full disk shows here.
[[nodiscard]] bool FlushOutput() { return std::fflush(stdout) == 0 && std::ferror(stdout) == 0; }

/// Runs the command line. Returns the exit code.
int Run(int argc, char** argv) {
  CLI::App app{
      "Slalom trains robots to drive through obstacle courses, and scores how well they drive.",
      "slalom"};
  app.set_version_flag("--version", std::string(slalom::base::Version()));
  app.set_help_all_flag("--help-all", "Print the help of every command and exit");
  app.require_subcommand(1);
  app.fallthrough(false);
  int exit_code = slalom::base::kExitOk;
  slalom::cli::AddTrainCommand(app, &exit_code);
  slalom::cli::AddEvaluateCommand(app, &exit_code);
  slalom::cli::AddReportCommand(app);
  slalom::cli::AddSweepCommand(app, &exit_code);
  slalom::cli::AddWatchCommand(app);
  slalom::cli::AddCoursesCommand(app);
  slalom::cli::AddActCommand(app);
  slalom::cli::AddExportCommand(app);
  slalom::cli::AddLocalServiceCommand(app, &exit_code);
  slalom::cli::AddServiceCommands(app, &exit_code);
  slalom::cli::AddStatusCommand(app);
  slalom::cli::AddConfigCommand(app);
  slalom::cli::AddKeysCommand(app);
  slalom::cli::AddBackupCommand(app);
  slalom::cli::AddMetricsCommand(app);
  app.footer(kFooter);  // Last, as commands would inherit it.

  const std::span<char* const> words(argv + 1, argv + std::max(argc, 1));
  const NamedCommand named = FindCommand(app, words);
  const std::string mistake = named.mistake.empty() ? EmptyValue(words) : named.mistake;
  if (!mistake.empty()) {
    fmt::print(stderr, "slalom: {}\n", mistake);
    return slalom::base::kExitUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForAllHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return app.exit(version);
  } catch (const CLI::ParseError& error) {
    const std::string unknown = UnknownOptions(named, words);
    if (unknown.empty()) app.exit(error);
    fmt::print(stderr, "{}", unknown);
    return slalom::base::kExitUsage;
  } catch (const slalom::base::Error& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
    return slalom::base::kExitError;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "slalom: not enough memory\n");
    return slalom::base::kExitError;
  } catch (const std::exception& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
    return slalom::base::kExitError;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    slalom::base::RaiseDescriptorLimit();
    slalom::nn::RestartWithBetterBlasKernel(argv);
    slalom::nn::SetMathThreads(1);
    slalom::base::InitLog();
    const int exit_code = Run(argc, argv);
    if (FlushOutput() || exit_code != slalom::base::kExitOk) return exit_code;
    fmt::print(stderr, "slalom: cannot write to standard output ({})\n", std::strerror(errno));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "slalom: %s\n", error.what());
  }
  return slalom::base::kExitError;
}
