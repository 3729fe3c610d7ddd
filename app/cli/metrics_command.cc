#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "app/cli/commands.h"
#include "metrics/catalogue.h"

namespace slalom::cli {

void AddMetricsCommand(CLI::App& app) {
  CLI::App* metrics = app.add_subcommand("metrics", "Print the page that explains all metrics");
  metrics->require_subcommand(1);
  metrics->add_subcommand("docs", "Print docs/metrics.md")->callback([] {
    fmt::print("{}", slalom::metrics::PrintMarkdown());
  });
}

}  // namespace slalom::cli
