#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/output.h"
#include "base/error.h"
#include "eval/report/agent_comparison.h"
#include "eval/report/comparison.h"
#include "eval/report/result.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

struct CompareOptions {
  std::vector<std::string> results;              ///< Each an agent of its own.
  std::vector<std::vector<std::string>> agents;  ///< A label and results, for each --agent.
  std::string output;
  bool force = false;
};

/// The results that the command line names, and their agents.
struct Agents {
  std::vector<eval::Result> results;
  std::vector<eval::AgentResults> agents;
};

void RequireLabels(const CompareOptions& options) {
  for (const std::vector<std::string>& agent : options.agents) {
    if (agent.size() >= 2 && !agent.front().empty()) continue;
    throw base::Error(
        fmt::format("--agent '{}': expected a label and at least one result, for example --agent "
                    "td3 runs/td3-1 "
                    "runs/td3-2",
                    agent.front()));
  }
}

/// The same evaluation twice in one agent would pass for two seeds and narrow its intervals.
void RequireDifferentFiles(const Agents& named) {
  for (const eval::AgentResults& agent : named.agents) {
    std::map<fs::path, std::string> seen;
    for (const std::size_t r : agent.results) {
      std::error_code error;
      const std::string& file = named.results[r].file;
      const auto [it, is_new] = seen.emplace(fs::weakly_canonical(file, error), file);
      if (is_new) continue;
      throw base::Error(
          fmt::format("agent {}: {} and {} are the same evaluation, expected one for "
                      "each seed",
                      agent.label, it->second, file));
    }
  }
}

/// Seeds that were driven in different physics would pass for seeds that differ.
void RequireOnePhysicsEach(const Agents& named) {
  for (const eval::AgentResults& agent : named.agents) {
    const eval::Result& first = named.results[agent.results.front()];
    for (const std::size_t r : agent.results) {
      const eval::Result& other = named.results[r];
      if (other.physics == first.physics) continue;
      throw base::Error(
          fmt::format("agent {}: {} and {} were driven in physics {} and {}, expected one "
                      "for all of its seeds",
                      agent.label, first.file, other.file, first.physics, other.physics));
    }
  }
}

void RequireDifferentLabels(const Agents& named) {
  for (std::size_t a = 0; a < named.agents.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (named.agents[a].label != named.agents[b].label) continue;
      throw base::Error(fmt::format(
          "two agents are called {}: the one of {} and the one of {}; name one of them otherwise "
          "with --agent LABEL RESULT...",
          named.agents[a].label, named.results[named.agents[b].results.front()].file,
          named.results[named.agents[a].results.front()].file));
    }
  }
}

Agents ReadAgents(const CompareOptions& options) {
  Agents named;
  for (const std::string& path : options.results) {
    named.results.push_back(eval::ReadResult(path));
  }
  const std::vector<std::string> labels = eval::Labels(named.results);
  for (std::size_t r = 0; r < labels.size(); ++r) named.agents.push_back({labels[r], {r}});
  for (const std::vector<std::string>& agent : options.agents) {
    eval::AgentResults& added = named.agents.emplace_back();
    added.label = agent.front();
    for (const std::string& path : std::span(agent).subspan(1)) {
      added.results.push_back(named.results.size());
      named.results.push_back(eval::ReadResult(path));
    }
  }
  return named;
}

void Compare(const CompareOptions& options) {
  if (options.results.empty() && options.agents.empty()) {
    throw base::Error(
        "nothing to compare: expected directories that `slalom evaluate --output` wrote, or "
        "--agent "
        "LABEL RESULT...");
  }
  RequireLabels(options);
  const fs::path directory = options.output;
  if (!options.output.empty()) RequireOutputDirectory(directory, options.force);
  const Agents named = ReadAgents(options);
  RequireDifferentLabels(named);
  RequireDifferentFiles(named);
  RequireOnePhysicsEach(named);
  eval::RequireComparable(named.results);
  const eval::AgentComparison comparison = eval::CompareAgents(named.results, named.agents);
  const std::string markdown = eval::MarkdownOf(comparison);
  fmt::print("{}", markdown);
  if (options.output.empty()) return;
  WritePage(directory, "compare",
            {eval::ComparisonPage(comparison), markdown, eval::CsvOf(comparison)});
}

}  // namespace

void AddCompareCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "compare", "Compare agents of several seeds on the same courses, with tests");
  command->footer(
      "Takes what `slalom evaluate --output` wrote, or directories of training runs. Each RESULT "
      "is "
      "an agent of one seed;\n"
      "each --agent is an agent with an evaluation for every seed that it was trained with. All "
      "must "
      "be of one protocol, on\n"
      "the same courses, with the same --episodes and --seed. docs/statistics.md says how to read "
      "the tables. Example:\n\n"
      "  slalom compare out/dwa --agent td3 out/td3-1 out/td3-2 out/td3-3 --output out/compare\n");
  auto options = std::make_shared<CompareOptions>();
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
                      "Directory to write compare.html, .md and .csv to");
  command->add_flag("--force", options->force, kForceHelp);
  command->callback([options] { Compare(*options); });
}

}  // namespace slalom::cli
