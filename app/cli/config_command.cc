#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/sweep/plan.h"
#include "app/train/agent_run_config.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "metrics/catalogue.h"

namespace slalom::cli {
namespace {

constexpr char kPageHead[] =
    "# Configuration\n\n"
    "Every key of a Slalom TOML file, with its default, the values it may take, its unit and its "
    "meaning.\n"
    "`./slalom config docs > docs/config.md` makes this page from the field lists in the code; a "
    "test checks that it is up\n"
    "to date.\n\n"
    "A file may start from another with `base = \"other.toml\"`: a path relative to itself, or a "
    "preset, such as\n"
    "`base = \"configs/fast.toml\"`. With `base = [\"a.toml\", \"b.toml\"]` it starts from "
    "several, of which a later one\n"
    "overrides an earlier one. On the command line `--set section.key=value` overrides all. "
    "Unknown keys and values out of\n"
    "range are errors. So is a key that is not at its default although nothing reads it, since its "
    "algorithm, encoder or\n"
    "kind is not chosen: the page says at such keys, or at their section, when they are read.\n";

constexpr char kAgentPageHead[] =
    "\n# Classical planners\n\n"
    "`slalom evaluate --agent NAME --config FILE` reads the sections `[environment]` and "
    "`[evaluation]` above, the keys\n"
    "`collection` and `generator_seed` of `[courses]`, and the sections below. It checks keys that "
    "only training reads, and\n"
    "ignores them. For planners, some keys of the sections above have other defaults:\n\n";

constexpr char kPlanPageHead[] =
    "\n# Sweep plans\n\n"
    "The keys of a plan, which `slalom sweep` reads ([sweeps.md](sweeps.md)). A section in double "
    "brackets may stand in a\n"
    "file several times, once for each axis, group and so on. A plan may start from another with "
    "`base`, as above; its\n"
    "`[[axis]]` sections, say, then take the place of all that the other has.\n";

/// A list with lines "- `environment.episode.step`: 0.05 s": the defaults of an agent's run that a
/// training run's are not.
std::string OtherDefaults() {
  train::AgentRunConfig agent;
  train::RunConfig run;
  const config::FieldList run_fields = config::ListFields(run);
  std::string text;
  for (const config::Field& field : config::ListFields(agent).fields) {
    const auto same = std::ranges::find(run_fields.fields, field.key, &config::Field::key);
    if (same == run_fields.fields.end()) continue;
    const std::string value = config::PrintValue(field);
    if (value == config::PrintValue(*same)) continue;
    text += fmt::format("- `{}`: {}{}{}\n", field.key, value, field.unit.empty() ? "" : " ",
                        field.unit);
  }
  return text;
}

struct PrintOptions {
  std::optional<std::string> file;
  std::vector<std::string> overrides;
  bool for_agent = false;
};

}  // namespace

void AddConfigCommand(CLI::App& app) {
  CLI::App* config = app.add_subcommand(
      "config",
      "Print all settings with the values that a run would use, or the page that explains them");
  config->require_subcommand(1);

  CLI::App* print =
      config->add_subcommand("print", "Print every key with the value that a run would use");
  auto options = std::make_shared<PrintOptions>();
  print->add_option("CONFIG", options->file, "TOML file [none: print the defaults]");
  print->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  print->add_flag(
      "--agent", options->for_agent,
      "Print what `slalom evaluate --agent` would use instead of what `slalom train` would");
  print->callback([options] {
    if (options->for_agent) {
      fmt::print("{}", config::ToToml(train::ResolveAgentRun([&](train::AgentRunConfig& agent) {
                   if (options->file) agent = train::ReadAgentRunConfig(*options->file, agent);
                   const config::FieldList fields = config::ListFields(agent);
                   for (const std::string& assignment : options->overrides) {
                     config::ApplyOverride(assignment, fields);
                   }
                 })));
    } else {
      fmt::print("{}",
                 config::ToToml(config::Load<train::RunConfig>(options->file, options->overrides)));
    }
  });

  CLI::App* docs = config->add_subcommand("docs", "Print docs/config.md");
  docs->callback([] {
    train::RunConfig defaults;
    planners::PlannersConfig planner_defaults;
    sweep::Plan plan_defaults;
    fmt::print("{}{}{}{}{}{}{}", kPageHead, config::PrintMarkdown(config::ListFields(defaults)),
               kAgentPageHead, OtherDefaults(),
               config::PrintMarkdown(config::ListFields(planner_defaults)), kPlanPageHead,
               config::PrintMarkdown(config::ListFields(plan_defaults)));
  });
  // Last, as the commands above would inherit it.
  config->footer(
      "Every key with its meaning is in docs/config.md. Example:\n\n"
      "  slalom config print configs/fast.toml --set learner.gamma=0.98");
}

void AddMetricsCommand(CLI::App& app) {
  CLI::App* metrics = app.add_subcommand("metrics", "Print the page that explains all metrics");
  metrics->require_subcommand(1);
  metrics->add_subcommand("docs", "Print docs/metrics.md")->callback([] {
    fmt::print("{}", slalom::metrics::PrintMarkdown());
  });
}

}  // namespace slalom::cli
