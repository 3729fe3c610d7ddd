#include "app/watch/run_facts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "app/train/resolved_run.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "learner/run/run_directory.h"

namespace slalom::watch {
namespace {

std::string List(const std::vector<int>& numbers) {
  return numbers.empty() ? "none" : fmt::format("{}", fmt::join(numbers, ", "));
}

/// The lines `key = value` of `config::Changes`.
std::vector<std::pair<std::string, std::string>> ChangesOf(const train::RunConfig& config) {
  std::vector<std::pair<std::string, std::string>> changes;
  std::istringstream lines(config::Changes(config));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find(" = ");
    changes.emplace_back(line.substr(0, equals), line.substr(equals + 3));
  }
  return changes;
}

}  // namespace

RunFacts FactsOf(const std::filesystem::path& directory) {
  RunFacts facts;
  train::RunConfig config;
  try {
    config::ReadTomlFile(run::RunDirectory{directory}.config(), config::ListFields(config));
    for (const train::Stage& stage : train::ResolveRecorded(config).stages) {
      facts.stages.push_back({stage.name, train::StageDirectory(directory, stage.name)});
    }
  } catch (const base::Error& error) {
    return {.lines = {{"config.toml", error.what()}}};
  }
  facts.max_steps = config.run.max_steps;
  facts.max_seconds = config.run.max_seconds;
  facts.changes = ChangesOf(config);
  facts.lines = {
      {"Directory", directory.string()},
      {"Algorithm", config.method.learner.algorithm},
      {"Training courses", config.courses.DescribeTrain()},
      {"Test courses", config.courses.test.empty() ? "none" : config.courses.test},
      {"Network",
       fmt::format("{}, encoder {}, head {}", base::EnumName(config.network.encoder),
                   List(config.network.encoder_layers), List(config.network.head_layers))},
      {"Environments", fmt::format("{}", config.actor.num_environments)},
      {"Batch", fmt::format("{} transitions, {:g} updates per step",
                            config.method.learner.batch_size, config.run.updates_per_step)},
      {"Ends after", fmt::format("{} steps{}", config.run.max_steps,
                                 config.run.max_seconds > 0.0
                                     ? fmt::format(" or {:g} s of training", config.run.max_seconds)
                                     : "")},
      {"Seed", fmt::format("{}", config.run.seed)}};
  return facts;
}

}  // namespace slalom::watch
