#include "eval/report/result_group.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;

std::string BaseLabel(const Result& result) {
  std::vector<std::string> profiles;
  for (const std::string& profile : result.profiles) profiles.push_back(fs::path(profile).stem());
  std::string label = result.agent;
  if (!profiles.empty()) label += fmt::format(" ({})", fmt::join(profiles, ", "));
  if (result.physics != "slalom") label += " in " + result.physics;
  return label;
}

}  // namespace

bool HaveSameCourses(const Result& a, const Result& b) {
  const auto& left = a.course_set_data.courses;
  const auto& right = b.course_set_data.courses;
  return a.course_set == b.course_set && a.collection == b.collection &&
         std::ranges::equal(a.courses, b.courses, {}, &ResultCourse::name, &ResultCourse::name) &&
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

std::vector<AgentResults> AgentsOf(std::span<const Result> results) {
  std::vector<AgentResults> agents;
  for (std::string& label : Labels(results)) agents.push_back({std::move(label), {agents.size()}});
  return agents;
}

std::vector<AgentResults> AgentsIn(const ResultGroup& group, std::span<const AgentResults> agents) {
  std::vector<AgentResults> inside;
  for (const AgentResults& agent : agents) {
    AgentResults of_group{agent.label, {}};
    for (const std::size_t r : agent.results) {
      if (std::ranges::find(group.results, r) != group.results.end()) of_group.results.push_back(r);
    }
    if (!of_group.results.empty()) inside.push_back(std::move(of_group));
  }
  return inside;
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

}  // namespace slalom::eval
