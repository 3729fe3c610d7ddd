#include "app/train/run_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace slalom::train {
namespace {

// Steps that a deterministic run is proposed to make in place of each second of its limit: about
// the speed of one thread of an ordinary processor.
constexpr double kStepsPerSecond = 10000.0;

bool EndsBySeconds(const RunConfig& config, double training_s) {
  return config.run.max_seconds > 0.0 && training_s >= config.run.max_seconds;
}

std::string SecondsOverride(double seconds) {
  return fmt::format("run.max_seconds={:.0f}", std::ceil(seconds));
}

}  // namespace

std::int64_t FirstUpdate(const RunConfig& config) {
  return config.run.learning_starts +
         static_cast<std::int64_t>(std::ceil(1.0 / config.run.updates_per_step));
}

std::string LongerLimit(const RunConfig& config, std::int64_t steps, double training_s) {
  if (EndsBySeconds(config, training_s)) {
    return SecondsOverride(2.0 * std::max(config.run.max_seconds, std::floor(training_s)));
  }
  return fmt::format("run.max_steps={}", 2 * std::max(config.run.max_steps, steps));
}

NothingLearned ExplainNoUpdate(const RunConfig& config, std::int64_t steps, double training_s) {
  const std::int64_t first = FirstUpdate(config);
  if (steps >= first) {
    return {fmt::format("no update could be made in {} steps, as replay.capacity = {} frames are "
                        "too few to sample from; start a new run with a larger one",
                        steps, config.replay.capacity),
            LongerLimit(config, steps, training_s)};
  }
  const bool by_seconds = EndsBySeconds(config, training_s);
  const double estimate = training_s * static_cast<double>(first) /
                          static_cast<double>(std::max<std::int64_t>(1, steps));
  const std::string ended = by_seconds ? fmt::format("run.max_seconds = {}", config.run.max_seconds)
                                       : fmt::format("run.max_steps = {}", config.run.max_steps);
  return {fmt::format("the run ended at {} after {} steps, and the first update comes after {} "
                      "(run.learning_starts = {}); raise the limit, or start a new run with a "
                      "smaller run.learning_starts",
                      ended, steps, first, config.run.learning_starts),
          by_seconds ? SecondsOverride(2.0 * std::max(config.run.max_seconds, estimate))
                     : fmt::format("run.max_steps={}", 2 * first)};
}

std::vector<std::string> OverridesForDeterminism(const RunConfig& config) {
  std::vector<std::string> overrides;
  if (config.run.max_seconds > 0.0) {
    const auto steps = static_cast<std::int64_t>(kStepsPerSecond * config.run.max_seconds);
    overrides.emplace_back("run.max_seconds=0");
    overrides.push_back(
        fmt::format("run.max_steps={}",
                    std::min(config.run.max_steps, std::max(steps, 2 * FirstUpdate(config)))));
  }
  return overrides;
}

}  // namespace slalom::train
