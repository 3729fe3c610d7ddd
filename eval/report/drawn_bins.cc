#include "eval/report/drawn_bins.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/split.h"
#include "eval/report/embedded_page.h"
#include "eval/report/table_text.h"
#include "eval/statistics/bootstrap.h"

namespace slalom::eval {
namespace {

constexpr std::size_t kMaxDrawnBins = 5;
constexpr std::size_t kMinEpisodesPerBin = 20;

/// The field in this result. Null if it is not drawn there, or not of this kind.
const DrawnField* FindDrawn(const Result& result, const std::string& key, bool is_number) {
  const auto it = std::ranges::find(result.drawn, key, &DrawnField::key);
  const bool is_there = it != result.drawn.end() && it->names.empty() == is_number;
  return is_there ? &*it : nullptr;
}

/// The value that a number has in the episodes of this result in which nothing is drawn
/// (`EnvironmentConfig::randomize_share`). Empty if it is drawn in all, or that is not known.
std::optional<double> FindOwnValue(const Result& result, const std::string& key) {
  const auto setting = [&result](const std::string& name) -> std::optional<double> {
    const auto it = result.settings.find("environment." + name);
    return it != result.settings.end() ? base::ParseNumber<double>(it->second) : std::nullopt;
  };
  return setting("randomize_share").value_or(1.0) < 1.0 ? setting(key) : std::nullopt;
}

/// Adds an agent to a bin: its episodes whose values satisfy `is_in`.
template <class IsIn>
void AddAgent(std::span<const Result> results, const AgentResults& agent, const std::string& key,
              bool is_number, const IsIn& is_in, DrawnBin& bin) {
  RatioTables tables;
  double num_episodes = 0.0;
  for (const std::size_t r : agent.results) {
    const DrawnField* const field = FindDrawn(results[r], key, is_number);
    if (field == nullptr) continue;
    std::vector<double>& sums = tables.sums.scores.emplace_back();
    std::vector<double>& counts = tables.counts.scores.emplace_back();
    for (std::size_t c = 0; c < results[r].courses.size(); ++c) {
      sums.push_back(0.0);
      counts.push_back(0.0);
      const std::vector<ResultEpisode>& episodes = results[r].courses[c].episodes;
      for (std::size_t k = 0; k < episodes.size(); ++k) {
        if (!is_in(*field, field->values[c][k])) continue;
        sums.back() += episodes[k].outcome == env::Outcome::kSuccess ? 1.0 : 0.0;
        counts.back() += 1.0;
      }
      num_episodes += counts.back();
    }
  }
  bin.num_episodes.push_back(static_cast<int>(num_episodes));
  bin.success_rates.push_back(num_episodes == 0.0 ? std::nullopt : BootstrapShare(tables));
}

/// The field in each result of the agents that draws it.
std::vector<const DrawnField*> FindAll(std::span<const Result> results,
                                       std::span<const AgentResults> agents, const std::string& key,
                                       bool is_number) {
  std::vector<const DrawnField*> fields;
  for (const AgentResults& agent : agents) {
    for (const std::size_t r : agent.results) {
      if (const auto* field = FindDrawn(results[r], key, is_number)) fields.push_back(field);
    }
  }
  return fields;
}

/// A bin for each name that any result has, in the order of the lists.
std::vector<DrawnBin> BinNames(std::span<const Result> results,
                               std::span<const AgentResults> agents, const std::string& key) {
  std::vector<std::string> names;
  for (const DrawnField* field : FindAll(results, agents, key, false)) {
    for (const std::string& name : field->names) {
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    }
  }
  std::vector<DrawnBin> bins;
  for (const std::string& name : names) {
    DrawnBin& bin = bins.emplace_back(DrawnBin{.label = name});
    const auto is_in = [&](const DrawnField& field, double value) {
      return field.names[static_cast<std::size_t>(value)] == name;
    };
    for (const AgentResults& agent : agents) AddAgent(results, agent, key, false, is_in, bin);
  }
  return bins;
}

std::vector<DrawnBin> BinNumbers(std::span<const Result> results,
                                 std::span<const AgentResults> agents, const std::string& key) {
  std::vector<double> values;
  std::set<double> own_values;
  const std::vector<const DrawnField*> fields = FindAll(results, agents, key, true);
  for (const DrawnField* field : fields) {
    for (const auto& course : field->values) {
      values.insert(values.end(), course.begin(), course.end());
    }
  }
  for (const AgentResults& agent : agents) {
    for (const std::size_t r : agent.results) {
      if (FindDrawn(results[r], key, true) == nullptr) continue;
      if (const auto own = FindOwnValue(results[r], key)) own_values.insert(*own);
    }
  }
  std::vector<DrawnBin> bins;
  const auto add_bin = [&](std::string label, const auto& is_in) {
    DrawnBin& bin = bins.emplace_back(DrawnBin{.label = std::move(label)});
    const auto of_field = [&](const DrawnField&, double value) { return is_in(value); };
    for (const AgentResults& agent : agents) AddAgent(results, agent, key, true, of_field, bin);
  };
  for (const double own : own_values) {
    if (std::erase(values, own) == 0) continue;
    add_bin(fmt::format("not drawn: {:.3g}", own), [own](double value) { return value == own; });
  }
  if (values.empty()) return bins;
  std::ranges::sort(values);
  const std::size_t num_bins = std::clamp<std::size_t>(
      values.size() / (fields.size() * kMinEpisodesPerBin), 1, kMaxDrawnBins);
  double low = values.front();
  for (std::size_t b = 0; b < num_bins; ++b) {
    const bool is_last = b + 1 == num_bins;
    const double high = is_last ? values.back() : values[(b + 1) * values.size() / num_bins];
    add_bin(fmt::format("{:.3g} – {:.3g}", low, high), [&](double value) {
      return !own_values.contains(value) && value >= low &&
             (value < high || (is_last && value == high));
    });
    low = high;
  }
  return bins;
}

}  // namespace

std::vector<DrawnFieldBins> BinByDrawnFields(std::span<const Result> results,
                                             std::span<const AgentResults> agents) {
  std::map<std::string, const DrawnField*> fields;
  for (const AgentResults& agent : agents) {
    for (const std::size_t r : agent.results) {
      for (const DrawnField& field : results[r].drawn) fields.emplace(field.key, &field);
    }
  }
  std::vector<DrawnFieldBins> bins;
  bins.reserve(fields.size());
  for (const auto& [key, field] : fields) {
    bins.push_back(
        {key, field->unit,
         field->names.empty() ? BinNumbers(results, agents, key) : BinNames(results, agents, key)});
  }
  return bins;
}

std::string MarkdownOf(std::span<const DrawnFieldBins> fields, std::span<const std::string> labels,
                       int level) {
  if (fields.empty()) return "";
  MarkdownTable table{.titles = {"field", "value"}, .num_names = 2};
  for (const std::string& label : labels) {
    table.titles.push_back(EscapeMarkdown(label) + " [%], episodes");
  }
  for (const DrawnFieldBins& field : fields) {
    for (const DrawnBin& bin : field.bins) {
      auto& row = table.rows.emplace_back();
      row = {&bin == &field.bins.front() ? MarkdownCode(field.key) : "",
             EscapeMarkdown(field.unit.empty() ? bin.label : bin.label + " " + field.unit)};
      for (std::size_t a = 0; a < labels.size(); ++a) {
        const std::string rate = EstimateText(bin.success_rates[a], 100.0, 1);
        row.push_back(bin.num_episodes[a] == 0 ? rate
                                               : fmt::format("{}, {}", rate, bin.num_episodes[a]));
      }
    }
  }
  return fmt::format("\n{} Success by randomised field\n\n{}", std::string(level, '#'),
                     table.Print());
}

nlohmann::json JsonOf(std::span<const DrawnFieldBins> fields) {
  nlohmann::json json = nlohmann::json::array();
  for (const DrawnFieldBins& field : fields) {
    nlohmann::json bins = nlohmann::json::array();
    for (const DrawnBin& bin : field.bins) {
      nlohmann::json rates = nlohmann::json::array();
      for (const auto& rate : bin.success_rates) rates.push_back(JsonOf(rate));
      bins.push_back(
          {{"label", bin.label}, {"episodes", bin.num_episodes}, {"rates", std::move(rates)}});
    }
    json.push_back({{"key", field.key}, {"unit", field.unit}, {"bins", std::move(bins)}});
  }
  return json;
}

}  // namespace slalom::eval
