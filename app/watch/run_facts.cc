#include "app/watch/run_facts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "learner/run/run_directory.h"

namespace slalom::watch {
namespace {

std::string List(const std::vector<int>& numbers) {
  return numbers.empty() ? "none" : fmt::format("{}", fmt::join(numbers, ", "));
}

}  // namespace

RunFacts FactsOf(const std::filesystem::path& directory) {
  train::RunConfig config;
  try {
    config::ReadTomlFile(run::RunDirectory{directory}.config(), config::ListFields(config));
  } catch (const base::Error& error) {
    return {.lines = {{"config.toml", error.what()}}};
  }
  RunFacts facts;
  facts.max_steps = config.run.max_steps;
  facts.max_seconds = config.run.max_seconds;
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
