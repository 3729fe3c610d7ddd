#include "eval/report/comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string_view>

#include "eval/csv_field.h"
#include "eval/report/drawn_bins.h"
#include "eval/report/setting_differences.h"
#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kContactRate = "contact_rate";

using Column = EstimateColumn<Figures>;

constexpr std::array<Column, 7> kColumns = {{
    {"success [%]", "success_rate", 100.0, 1, false,
     [](const Figures& f) -> std::optional<Estimate> { return f.success_rate; }},
    {"collision [%]", "collision_rate", 100.0, 1, false,
     [](const Figures& f) -> std::optional<Estimate> { return f.collision_rate; }},
    {"timeout [%]", "timeout_rate", 100.0, 1, false,
     [](const Figures& f) -> std::optional<Estimate> { return f.timeout_rate; }},
    {"touched [%]", kContactRate, 100.0, 1, false,
     [](const Figures& f) -> std::optional<Estimate> { return f.contact_rate; }},
    {"traversal [s]", "traversal_time_s", 1.0, 1, false,
     [](const Figures& f) { return f.traversal_time; }},
    {"survival [s]", "survival_time_s", 1.0, 1, false,
     [](const Figures& f) { return f.survival_time; }},
    {"BARN score", "barn_score", 1.0, 3, false,
     [](const Figures& f) -> std::optional<Estimate> { return f.barn_score; }},
}};

/// Contacts tell more than collisions only if these end nothing.
std::vector<const Column*> ColumnsFor(const Result& result) {
  std::vector<const Column*> columns;
  for (const Column& column : kColumns) {
    if (column.key != kContactRate || !result.collision_ends()) columns.push_back(&column);
  }
  return columns;
}

std::string BaseLabel(const Result& result) {
  std::vector<std::string> profiles;
  for (const std::string& profile : result.profiles) profiles.push_back(fs::path(profile).stem());
  std::string label = result.agent;
  if (!profiles.empty()) label += fmt::format(" ({})", fmt::join(profiles, ", "));
  if (result.physics != "slalom") label += " in " + result.physics;
  return label;
}

std::string SizeText(const ResultGroup& group, std::span<const Result> results) {
  const Result& first = results[group.results.front()];
  return fmt::format("{} course{}", first.courses.size(), first.courses.size() == 1 ? "" : "s");
}

}  // namespace

bool HaveSameCourses(const Result& a, const Result& b) {
  const auto& left = a.course_set_data.courses;
  const auto& right = b.course_set_data.courses;
  return a.course_set == b.course_set && a.collection == b.collection &&
         std::ranges::equal(left, right, [](const auto& x, const auto& y) { return *x == *y; });
}

std::vector<ResultGroup> GroupByCourses(std::span<const Result> results) {
  std::vector<ResultGroup> groups;
  for (std::size_t r = 0; r < results.size(); ++r) {
    const auto group = std::ranges::find_if(groups, [&](const ResultGroup& g) {
      return HaveSameCourses(results[g.results.front()], results[r]);
    });
    if (group != groups.end()) {
      group->results.push_back(r);
      continue;
    }
    const Result& result = results[r];
    std::string title = result.course_set;
    if (!result.collection.empty()) {
      title += " of " + fs::path(result.collection).lexically_normal().string();
    }
    const auto num_alike = std::ranges::count_if(
        groups, [&](const ResultGroup& g) { return g.title.starts_with(title); });
    if (num_alike > 0) title += fmt::format(" (other courses, {})", num_alike + 1);
    groups.push_back({std::move(title), {r}});
  }
  return groups;
}

std::vector<std::string> Labels(std::span<const Result> results) {
  std::vector<std::string> labels(results.size());
  for (const ResultGroup& group : GroupByCourses(results)) {
    const auto is_taken = [&](const std::string& label, std::size_t until) {
      return std::ranges::any_of(group.results,
                                 [&](std::size_t r) { return r < until && labels[r] == label; });
    };
    for (const std::size_t r : group.results) {
      const std::string base = BaseLabel(results[r]);
      const auto num_alike = std::ranges::count_if(
          group.results, [&](std::size_t other) { return BaseLabel(results[other]) == base; });
      labels[r] = base;
      if (num_alike > 1) {
        const fs::path directory = fs::path(results[r].file).parent_path();
        labels[r] += fmt::format(" [{}]", directory.filename().string());
      }
      const std::string with_directory = labels[r];
      for (int k = 2; is_taken(labels[r], r); ++k)
        labels[r] = fmt::format("{} {}", with_directory, k);
    }
  }
  return labels;
}

std::vector<AgentResults> AgentsOf(const ResultGroup& group, std::span<const std::string> labels) {
  std::vector<AgentResults> agents;
  for (const std::size_t r : group.results) agents.push_back({labels[r], {r}});
  return agents;
}

std::string ProtocolSentence(const Result& result) {
  const auto value = [&](const char* key) {
    const auto it = result.protocol.find(key);
    std::string text = it == result.protocol.end() ? "?" : it->second;
    std::erase(text, '"');
    if (text.ends_with(".0")) text.resize(text.size() - 2);
    return text;
  };
  const std::string clock =
      value("clock_start_distance_m") == "0"
          ? ""
          : fmt::format(" from when the robot has moved {} m", value("clock_start_distance_m"));
  const std::string finish =
      result.protocol.contains("finish_ahead_m")
          ? fmt::format(" or {} m ahead of the start", value("finish_ahead_m"))
          : "";
  return fmt::format(
      "Protocol {}: {} s{}, goal within {} m{}, {}, start within {} m and {} rad.", value("name"),
      value("time_limit_s"), clock, value("goal_tolerance_m"), finish,
      result.collision_ends() ? "a collision ends the episode" : "collisions end nothing",
      value("start_position_jitter_m"), value("start_yaw_jitter_rad"));
}

std::string OverlapSentence(const Result& result, const std::string& label) {
  const auto& overlap = result.training_overlap;
  if (!overlap || overlap->num_courses == 0) return "";
  return fmt::format("{} was trained on {} of these {} courses ({}).", label, overlap->num_courses,
                     overlap->num_scored, overlap->trained_on);
}

std::string MarkdownComparison(std::span<const Result> results) {
  const std::vector<std::string> labels = Labels(results);
  std::string text =
      "# Evaluations\n\n" + EscapeMarkdown(ProtocolSentence(results.front())) +
      " In brackets 95 % intervals for further courses of the same kind: Wilson's for rates, "
      "Student's t for times and scores (`slalom compare`: bootstrap, which knows of "
      "seeds, too).\n";
  auto out = std::back_inserter(text);
  for (const ResultGroup& group : GroupByCourses(results)) {
    const auto columns = ColumnsFor(results.front());
    MarkdownTable table{.titles = {"agent", "episodes"}};
    for (const Column* column : columns) table.titles.emplace_back(column->title);
    for (const std::size_t r : group.results) {
      auto& row = table.rows.emplace_back();
      row = {EscapeMarkdown(labels[r]), std::to_string(results[r].set.num_episodes)};
      for (const Column* column : columns) row.push_back(CellText(*column, results[r].set));
    }
    fmt::format_to(out, "\n## {}\n\n{}.\n\n{}", EscapeMarkdown(group.title),
                   SizeText(group, results), table.Print());
    for (const std::size_t r : group.results) {
      const std::string overlap = OverlapSentence(results[r], labels[r]);
      if (overlap.empty()) continue;
      fmt::format_to(out, "\n**Trained on its test:** {}\n", EscapeMarkdown(overlap));
    }
    std::vector<std::string> group_labels;
    for (const std::size_t r : group.results) group_labels.push_back(labels[r]);
    text += MarkdownOf(BinByDrawnFields(results, group), group_labels, 3);
    text += MarkdownOf(FindSettingDifferences(results, AgentsOf(group, labels)), 3);
  }
  return text;
}

std::string CsvComparison(std::span<const Result> results) {
  const std::vector<std::string> labels = Labels(results);
  std::string text =
      "courses,agent,kind,protocol,num_courses,episodes,successes,collisions,timeouts,contacts";
  auto out = std::back_inserter(text);
  for (const Column& column : kColumns) fmt::format_to(out, ",{0},{0}_low,{0}_high", column.key);
  text += ",barn_score_until_2024,mean_path_length_m,file\n";
  for (const ResultGroup& group : GroupByCourses(results)) {
    for (const std::size_t r : group.results) {
      const Result& result = results[r];
      std::string protocol = result.protocol.at("name");
      std::erase(protocol, '"');
      fmt::format_to(out, "{},{},{},{},{},{},{},{},{},{}", CsvField(group.title),
                     CsvField(labels[r]), CsvField(result.kind), CsvField(protocol),
                     result.courses.size(), result.set.num_episodes, result.set.num_successes,
                     result.set.num_collisions, result.set.num_timeouts, result.set.num_contacts);
      for (const Column& column : kColumns) {
        text += ',' + CsvEstimate(column.estimate(result.set));
      }
      fmt::format_to(out, ",{:.6f},{:.4f},{}\n", result.set.barn_score_until_2024.value,
                     result.set.mean_path_length, CsvField(result.file));
    }
  }
  return text;
}

}  // namespace slalom::eval
