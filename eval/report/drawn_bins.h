#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "eval/report/result.h"
#include "eval/report/result_group.h"
#include "eval/statistics/statistics.h"

/// Success against the values of randomised fields (sim/randomized_config.h).

namespace slalom::eval {

/// Success in the episodes with one name of a field, or with numbers between two.
struct DrawnBin {
  std::string label;  ///< "0.024 – 0.048", "not drawn: 0.03" or "gazebo".
  /// Of each agent: the number of its episodes, and its success rate in them (`BootstrapShare`;
  /// empty without episodes).
  std::vector<int> num_episodes{};
  std::vector<std::optional<Estimate>> success_rates{};
};

/// The bins of one field.
struct DrawnFieldBins {
  std::string key;   ///< Below [environment], "robot.command_delay".
  std::string unit;  ///< Empty for names, and for numbers without one.
  std::vector<DrawnBin> bins;
};

/// Returns the bins of each field that is drawn in any result of the agents, in the order of their
/// keys. Names have a bin each. So has the number that a field has where it is not drawn
/// (`EnvironmentConfig::randomize_share`). Drawn numbers are cut at the quantiles of all that are
/// drawn, into at most five bins of at least 20 episodes an evaluation; fewer than 40 make
/// one.
std::vector<DrawnFieldBins> BinByDrawnFields(std::span<const Result> results,
                                             std::span<const AgentResults> agents);

/// Returns a heading and a Markdown table with a column for each agent, after an empty line.
/// `labels`: of the group's agents. `level`: of the heading. Empty if nothing is drawn.
std::string MarkdownOf(std::span<const DrawnFieldBins> fields, std::span<const std::string> labels,
                       int level);

/// Returns a list of objects with the keys `key`, `unit` and `bins`; a bin has `label`, `episodes`
/// and `rates`, lists with a number or an estimate for each agent.
nlohmann::json JsonOf(std::span<const DrawnFieldBins> fields);

}  // namespace slalom::eval
