#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

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

/// CLI11 would say of a mistyped command that a command is missing. Empty: none is mistyped.
std::string UnknownCommand(const CLI::App& app, int argc, char** argv) {
  const CLI::App* parent = &app;
  std::string path = "slalom";
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) {
    const auto is_named = [&](const CLI::App* command) { return command->check_name(argv[i]); };
    const auto named = parent->get_subcommands(is_named);
    if (named.empty())
      return fmt::format("no command '{} {}'; {} --help lists them", path, argv[i], path);
    parent = named.front();
    path += fmt::format(" {}", argv[i]);
    if (parent->get_subcommands([](const CLI::App*) { return true; }).empty()) break;
  }
  return "";
}

}  // namespace

int main(int argc, char** argv) {
  slalom::policy::RestartWithBetterBlasKernel(argv);
  slalom::policy::SetMathThreads(1);

  CLI::App app{"Slalom trains robots to drive through obstacle courses, and measures them.",
               "slalom"};
  app.set_version_flag("--version", std::string(slalom::cli::Version()));
  app.set_help_all_flag("--help-all", "Help of every command");
  app.require_subcommand(1);
  app.fallthrough(false);
  int exit_code = slalom::cli::kExitOk;
  slalom::cli::AddTrainCommand(app, &exit_code);
  slalom::cli::AddEvaluateCommand(app, &exit_code);
  slalom::cli::AddReportCommand(app);
  slalom::cli::AddWatchCommand(app);
  slalom::cli::AddCoursesCommand(app);
  slalom::cli::AddServiceCommands(app, &exit_code);
  slalom::cli::AddStatusCommand(app);
  slalom::cli::AddConfigCommand(app);
  slalom::cli::AddKeysCommand(app);
  slalom::cli::AddMetricsCommand(app);
  app.footer(kFooter);  // Last, as commands would inherit it.

  slalom::base::InitLog();
  if (const std::string unknown = UnknownCommand(app, argc, argv); !unknown.empty()) {
    fmt::print(stderr, "slalom: {}\n", unknown);
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
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "slalom: not enough memory\n");
    return slalom::cli::kExitError;
  } catch (const std::exception& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
    return slalom::cli::kExitError;
  }
  return exit_code;
}
