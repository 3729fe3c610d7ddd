#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "base/error.h"
#include "base/log.h"
#include "cli/commands.h"
#include "cli/version.h"
#include "policy/blas.h"

namespace {

constexpr char kFooter[] =
    "First run:   slalom train configs/quickstart.toml      a policy that drives, in a minute or "
    "two\n"
    "Then:        slalom evaluate --policy runs/quickstart/policy.safetensors --courses "
    "static-test\n"
    "             slalom courses render --courses static-test --output courses.png\n"
    "Settings:    slalom config print configs/fast.toml, docs/config.md";

}  // namespace

int main(int argc, char** argv) {
  slalom::policy::RestartWithBetterBlasKernel(argv);
  slalom::policy::SetMathThreads(1);

  CLI::App app{"Slalom trains robots to drive through obstacle courses, and measures them.",
               "slalom"};
  app.footer(kFooter);
  app.set_version_flag("--version", std::string(slalom::cli::Version()));
  app.set_help_all_flag("--help-all", "Help of every command");
  app.require_subcommand(1);
  app.fallthrough(false);
  int exit_code = slalom::cli::kExitOk;
  slalom::cli::AddTrainCommand(app, &exit_code);
  slalom::cli::AddEvaluateCommand(app, &exit_code);
  slalom::cli::AddCoursesCommand(app);
  slalom::cli::AddConfigCommand(app);

  slalom::base::InitLog();
  const auto is_named = [&](const CLI::App* command) { return command->check_name(argv[1]); };
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(is_named).empty()) {
    fmt::print(stderr, "slalom: no command '{}'; slalom --help lists them\n", argv[1]);
    return slalom::cli::kExitUsage;
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
    app.exit(error);
    return slalom::cli::kExitUsage;
  } catch (const slalom::base::Error& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
    return slalom::cli::kExitError;
  } catch (const std::exception& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
    return slalom::cli::kExitError;
  }
  return exit_code;
}
