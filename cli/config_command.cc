#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "config/config.h"
#include "train/run_config.h"

namespace slalom::cli {
namespace {

constexpr char kPageHead[] =
    "# Configuration\n\n"
    "Every key of a Slalom TOML file, with its default, the values it may take, its unit and its "
    "meaning. Made by\n"
    "`./slalom config docs > docs/config.md` from the field lists in the code; a test checks that "
    "it is fresh.\n\n"
    "A file may start from another with `base = \"other.toml\"` (a path relative to itself). On "
    "the command line\n"
    "`--set section.key=value` overrides both. Unknown keys and values out of range are errors.\n";

struct PrintOptions {
  std::optional<std::string> file;
  std::vector<std::string> overrides;
};

}  // namespace

void AddConfigCommand(CLI::App& app) {
  CLI::App* config =
      app.add_subcommand("config", "Print a configuration as resolved, or the page of all keys");
  config->require_subcommand(1);

  CLI::App* print =
      config->add_subcommand("print", "Print every key with the value a run would use");
  auto options = std::make_shared<PrintOptions>();
  print->add_option("CONFIG", options->file, "TOML file; without one, the defaults");
  print->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  print->callback([options] {
    const auto loaded = config::Load<train::RunConfig>(options->file, options->overrides);
    fmt::print("{}", config::ToToml(loaded));
  });

  CLI::App* docs = config->add_subcommand("docs", "Print docs/config.md");
  docs->callback([] {
    train::RunConfig defaults;
    fmt::print("{}{}", kPageHead, config::PrintMarkdown(config::ListFields(defaults)));
  });
  // Last, as the commands above would inherit it.
  config->footer(
      "Every key with its meaning is in docs/config.md. Example:\n\n"
      "  slalom config print configs/fast.toml --set learner.gamma=0.98");
}

}  // namespace slalom::cli
