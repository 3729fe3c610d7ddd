#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/output.h"
#include "eval/report/comparison.h"
#include "eval/report/report_page.h"
#include "eval/report/result.h"

namespace slalom::cli {
namespace {

struct ReportOptions {
  std::vector<std::string> results;
  std::string output;
  bool force = false;
};

void Report(const ReportOptions& options) {
  std::vector<eval::Result> results;
  for (const std::string& path : options.results) results.push_back(eval::ReadResult(path));
  eval::RequireSameProtocol(results);
  const std::filesystem::path directory = options.output;
  RequireOutputDirectory(directory, options.force);
  const std::string markdown = eval::MarkdownComparison(results);
  fmt::print("{}", markdown);
  WritePage(directory, "report",
            {eval::ReportPage(results), markdown, eval::CsvComparison(results)});
}

}  // namespace

void AddReportCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("report", "Compare evaluations in tables and on one page with plots");
  command->footer(
      "Takes what `slalom evaluate --output` wrote, for any number of agents and course sets under "
      "one protocol, and writes\n"
      "report.html (which opens without a network), report.md and report.csv "
      "(docs/evaluation.md). Example:\n\n"
      "  slalom evaluate --agent dwa --courses static-test --output out/dwa\n"
      "  slalom evaluate --policy runs/fast/policy.safetensors --courses static-test --output "
      "out/fast\n"
      "  slalom report out/dwa out/fast --output out/report\n");
  auto options = std::make_shared<ReportOptions>();
  command
      ->add_option("RESULT", options->results,
                   "Directories that `slalom evaluate --output` wrote, or their evaluation.json")
      ->required();
  command->add_option("--output", options->output, "Directory to write the report to")->required();
  command->add_flag("--force", options->force, kForceHelp);
  command->callback([options] { Report(*options); });
}

}  // namespace slalom::cli
