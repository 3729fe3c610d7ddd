#include "eval/report/setting_differences.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

/// Keys, and sections that end in a dot, which differ between any two runs or machines and change
/// no figure.
constexpr std::array<std::string_view, 3> kIdleKeys = {"run.name", "service.", "security."};

bool IsIdle(std::string_view key) {
  return std::ranges::any_of(kIdleKeys, [key](std::string_view idle) {
    return idle.ends_with('.') ? key.starts_with(idle) : key == idle;
  });
}

/// The values of a key in the results of an agent. Empty if one of them lacks it.
std::set<std::string> ValuesOf(const std::string& key, std::span<const Result> results,
                               const AgentResults& agent) {
  std::set<std::string> values;
  for (const std::size_t r : agent.results) {
    const auto it = results[r].settings.find(key);
    if (it == results[r].settings.end()) return {};
    values.insert(it->second);
  }
  return values;
}

/// Agents of one kind, each with a config.
SettingDifferences DifferencesAmong(std::span<const Result> results,
                                    std::span<const AgentResults> agents) {
  const Result& first = results[agents.front().results.front()];
  SettingDifferences differences{.kind = first.kind, .labels = {}, .rows = {}};
  for (const AgentResults& agent : agents) differences.labels.push_back(agent.label);
  for (const auto& [key, value] : first.settings) {
    if (IsIdle(key)) continue;
    std::vector<std::set<std::string>> values;
    for (const AgentResults& agent : agents) values.push_back(ValuesOf(key, results, agent));
    const bool all_have_it = std::ranges::none_of(values, &std::set<std::string>::empty);
    if (!all_have_it || std::ranges::count(values, values.front()) == std::ssize(values)) continue;
    auto& row = differences.rows.emplace_back();
    row.key = key;
    for (const auto& of_agent : values) {
      row.values.push_back(fmt::format("{}", fmt::join(of_agent, ", ")));
    }
  }
  return differences;
}

std::string TitleOf(const SettingDifferences& differences) {
  if (differences.kind == "policy") return "Settings in which the policies differ";
  if (differences.kind == "planner") return "Settings in which the planners differ";
  return "Settings in which agents differ";
}

}  // namespace

std::vector<SettingDifferences> FindSettingDifferences(std::span<const Result> results,
                                                       std::span<const AgentResults> agents) {
  std::vector<std::pair<std::string, std::vector<AgentResults>>> kinds;
  for (const AgentResults& agent : agents) {
    const std::string& kind = results[agent.results.front()].kind;
    const bool is_known = std::ranges::all_of(agent.results, [&](std::size_t r) {
      return !results[r].settings.empty() && results[r].kind == kind;
    });
    if (!is_known) continue;
    auto found = std::ranges::find(kinds, kind, [](const auto& k) { return k.first; });
    if (found == kinds.end()) found = kinds.insert(found, {kind, {}});
    found->second.push_back(agent);
  }
  std::vector<SettingDifferences> all;
  for (const auto& [kind, of_kind] : kinds) {
    SettingDifferences differences = DifferencesAmong(results, of_kind);
    if (!differences.rows.empty()) all.push_back(std::move(differences));
  }
  return all;
}

std::string MarkdownOf(std::span<const SettingDifferences> differences, int level) {
  std::string text;
  for (const SettingDifferences& of_kind : differences) {
    MarkdownTable table{.titles = {"key"}, .num_names = 1 + of_kind.labels.size()};
    for (const std::string& label : of_kind.labels) table.titles.push_back(EscapeMarkdown(label));
    for (const SettingDifferences::Row& row : of_kind.rows) {
      auto& cells = table.rows.emplace_back();
      cells.push_back(MarkdownCode(row.key));
      for (const std::string& value : row.values) cells.push_back(MarkdownCode(value));
    }
    text += fmt::format("\n{} {}\n\n{}", std::string(static_cast<std::size_t>(level), '#'),
                        TitleOf(of_kind), table.Print());
  }
  return text;
}

nlohmann::json JsonOf(std::span<const SettingDifferences> differences) {
  nlohmann::json list = nlohmann::json::array();
  for (const SettingDifferences& of_kind : differences) {
    nlohmann::json rows = nlohmann::json::array();
    for (const SettingDifferences::Row& row : of_kind.rows) {
      nlohmann::json cells = nlohmann::json::array({row.key});
      for (const std::string& value : row.values) cells.push_back(value);
      rows.push_back(std::move(cells));
    }
    list.push_back({{"kind", of_kind.kind},
                    {"title", TitleOf(of_kind)},
                    {"labels", of_kind.labels},
                    {"rows", std::move(rows)}});
  }
  return list;
}

}  // namespace slalom::eval
