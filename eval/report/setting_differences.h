#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "eval/report/result.h"
#include "eval/report/result_group.h"

namespace slalom::eval {

/// The settings in which agents of one kind differ. A value.
struct SettingDifferences {
  /// A key of the config. `values` are TOML, one of each agent; several of an agent whose seeds
  /// differ are separated by commas.
  struct Row {
    std::string key;
    std::vector<std::string> values;
  };
  std::string kind;                 ///< "policy" or "planner": their configs have other sections.
  std::vector<std::string> labels;  ///< Agents whose config is known, at least two.
  std::vector<Row> rows;            ///< At least one, sorted by key.
};

/// Returns, for each kind of agent, the keys whose values are not the same in all agents. Kinds
/// without such a key are left out. Only keys that every agent of the kind has are compared. Names
/// of runs are left out, as are the addresses, keys and directories of a service.
std::vector<SettingDifferences> FindSettingDifferences(std::span<const Result> results,
                                                       std::span<const AgentResults> agents);

/// Returns a heading and a Markdown table for each kind, after an empty line. `level`: of the
/// headings. Empty if there are no differences.
std::string MarkdownOf(std::span<const SettingDifferences> differences, int level);

/// Returns a list of objects with the keys `kind`, `title`, `labels` and `rows`. A row is a list:
/// the key, then the values.
nlohmann::json JsonOf(std::span<const SettingDifferences> differences);

}  // namespace slalom::eval
