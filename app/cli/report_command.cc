#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/output.h"
#include "base/error.h"
#include "eval/comparison/comparison.h"
#include "eval/comparison/printers.h"
#include "eval/comparison/report_page.h"
#include "eval/report/result.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  std::vector<std::string> results;              ///< Each an agent of its own.
  std::vector<std::vector<std::string>> agents;  ///< A label and results, for each --agent.
  std::optional<std::string> output;
  bool force = false;
};

/// The results that the command line names, and their agents.
struct Agents {
  std::vector<eval::Result> results;
  std::vector<eval::AgentResults> agents;
};

void RequireLabels(const ReportOptions& options) {
  for (const std::vector<std::string>& agent : options.agents) {
    if (agent.size() >= 2 && !agent.front().empty()) continue;
    throw base::Error(
        "--agent '{}': expected a label and at least one result, for example --agent td3 "
        "runs/td3-1 runs/td3-2",
        agent.front());
  }
}

/// The same evaluation twice in one agent would pass for two seeds and narrow its intervals. Seeds
/// that were driven in different physics would pass for seeds that differ.
void RequireSeeds(const Agents& named, const eval::AgentResults& agent) {
  std::map<fs::path, std::string> seen;
  const eval::Result& first = named.results[agent.results.front()];
  for (const std::size_t r : agent.results) {
    std::error_code error;
    const eval::Result& result = named.results[r];
    const auto [it, is_new] = seen.emplace(fs::weakly_canonical(result.file, error), result.file);
    if (!is_new) {
      throw base::Error("agent {}: {} and {} are the same evaluation, expected one for each seed",
                        agent.label, it->second, result.file);
    }
    base::ThrowIf(
        result.physics != first.physics,
        "agent {}: {} and {} were driven in physics {} and {}, expected one for all of its seeds",
        agent.label, first.file, result.file, first.physics, result.physics);
  }
}

void RequireDifferentLabels(const Agents& named) {
  for (std::size_t a = 0; a < named.agents.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (named.agents[a].label != named.agents[b].label) continue;
      throw base::Error(
          "two agents are called {}: the one of {} and the one of {}; name one of them otherwise "
          "with --agent LABEL RESULT...",
          named.agents[a].label, named.results[named.agents[b].results.front()].file,
          named.results[named.agents[a].results.front()].file);
    }
  }
}

Agents ReadAgents(const ReportOptions& options) {
  Agents named;
  for (const std::string& path : options.results) named.results.push_back(eval::ReadResult(path));
  named.agents = eval::AgentsOf(named.results);
  for (const std::vector<std::string>& agent : options.agents) {
    eval::AgentResults& added = named.agents.emplace_back();
    added.label = agent.front();
    for (const std::string& path : std::span(agent).subspan(1)) {
      added.results.push_back(named.results.size());
      named.results.push_back(eval::ReadResult(path));
    }
  }
  if (options.agents.empty()) {
    eval::RequireSameProtocol(named.results);
    return named;
  }
  RequireDifferentLabels(named);
  for (const eval::AgentResults& agent : named.agents) RequireSeeds(named, agent);
  eval::RequireComparable(named.results);
  return named;
}

void Report(const ReportOptions& options) {
  base::ThrowIf(options.results.empty() && options.agents.empty(),
                "nothing to report: expected directories that `slalom evaluate --output` wrote, or "
                "--agent LABEL RESULT...");
  RequireLabels(options);
  if (options.output) RequireOutputDirectory(*options.output, options.force);
  const Agents named = ReadAgents(options);
  const eval::Comparison comparison = eval::CompareResults(named.results, named.agents);
  fmt::print("{}", eval::MarkdownOf(comparison.groups));
  if (!options.output) return;
  eval::WriteReport(comparison, *options.output);
  fmt::print("\npage: {}/report.html, tables: report.md, report.csv, report-pairs.csv beside it\n",
             *options.output);
}

}  // namespace

void AddReportCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "report", "Compare agents in tables with tests, and on one page with plots");
  command->footer(
      "Takes what `slalom evaluate --output` wrote, under one protocol. Each RESULT is an agent of "
      "one seed; results on several\n"
      "course sets are compared set by set. Each --agent is an agent with an evaluation for every "
      "seed that it was trained with;\n"
      "then all results must be on the same courses, with the same --episodes and --seed.\n"
      "docs/statistics.md says how to read the tables. Examples:\n\n"
      "  slalom evaluate --agent dwa --courses static-test --output out/dwa\n"
      "  slalom evaluate --policy runs/fast/policy.safetensors --courses static-test --output "
      "out/fast\n"
      "  slalom report out/dwa out/fast --output out/report\n"
      "  slalom report out/dwa --agent td3 out/td3-1 out/td3-2 out/td3-3 --output out/seeds\n");
  auto options = std::make_shared<ReportOptions>();
  command->add_option("RESULT", options->results,
                      "Directories that `slalom evaluate --output` wrote, or their "
                      "evaluation.json: an agent each");
  command
      ->add_option_function<std::vector<std::string>>(
          "--agent",
          [options](const std::vector<std::string>& agent) { options->agents.push_back(agent); },
          "A label, then the results of this agent's seeds (repeatable)")
      ->trigger_on_parse()
      ->type_name("LABEL RESULT");
  command->add_option("--output", options->output,
                      "Directory to write report.html, .md and .csv to");
  command->add_flag("--force", options->force, kForceHelp);
  command->callback([options] { Report(*options); });
}

}  // namespace slalom::cli
