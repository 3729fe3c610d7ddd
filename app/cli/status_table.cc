#include "app/cli/status_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "base/progress.h"

namespace slalom::cli {
namespace {

using Columns = std::vector<std::pair<std::string, std::string>>;  // Title and figure.

constexpr char kSecondsLeft[] = "seconds_left";  // A figure of the learner.

/// "1.2M", "0.93", "2:05", "-": a number for people.
std::string Figure(const proto::Report& report, const std::string& key) {
  const auto it = report.figures.find(key);
  if (it == report.figures.end() || std::isnan(it->second)) return "-";
  const double value = it->second;
  if (key == kSecondsLeft) return base::FormatDuration(value);
  return std::abs(value) >= 1000.0 || value == std::floor(value) ? base::FormatCount(value)
                                                                 : fmt::format("{:.3g}", value);
}

std::string Line(const proto::Report& report, const Columns& columns) {
  std::string line = fmt::format("{:<24}", report.name);
  for (const auto& [title, key] : columns) line += fmt::format(" {:>13}", Figure(report, key));
  return line;
}

/// Sums of the actors' figures; of the policy the oldest, of the success the mean.
proto::Report SumOf(const std::vector<const proto::RoleStatus*>& entries, const Columns& columns) {
  proto::Report sum;
  sum.name = fmt::format("all {}", entries.size());
  for (const auto& [title, key] : columns) {
    std::vector<double> values;
    for (const proto::RoleStatus* entry : entries) {
      const auto it = entry->report.figures.find(key);
      if (it != entry->report.figures.end() && !std::isnan(it->second)) {
        values.push_back(it->second);
      }
    }
    if (values.empty()) continue;
    double& figure = sum.figures[key];
    for (const double value : values) figure += value;
    if (key == "success_rate") figure /= static_cast<double>(values.size());
    if (key == "policy_version") figure = *std::ranges::min_element(values);
  }
  return sum;
}

void AddTable(std::string& text, const proto::StatusReply& status, std::string_view role,
              std::string_view title, const Columns& columns) {
  std::vector<const proto::RoleStatus*> entries;
  for (const proto::RoleStatus& entry : status.roles) {
    if (entry.report.role == role) entries.push_back(&entry);
  }
  if (entries.empty()) return;
  text += fmt::format("{:<24}", title);
  for (const auto& [name, key] : columns) text += fmt::format(" {:>13}", name);
  text += "  heard of\n";
  if (entries.size() > static_cast<std::size_t>(kMostActors)) {
    const auto is_there = [](const proto::RoleStatus* entry) { return entry->connected; };
    const auto num_there = std::ranges::count_if(entries, is_there);
    text += Line(SumOf(entries, columns), columns) +
            fmt::format("  {} of them, {} are GONE\n", num_there, entries.size() - num_there);
    std::erase_if(entries, is_there);
    entries.resize(std::min<std::size_t>(entries.size(), kMostActors));
  }
  for (const proto::RoleStatus* entry : entries) {
    text += Line(entry->report, columns) +
            (entry->connected ? fmt::format("  {:.0f} s ago\n", entry->age_s)
                              : fmt::format("  GONE, {:.0f} s ago\n", entry->age_s));
  }
  text += "\n";
}

/// A line that says whether all is well or, for each thing that is not, a line that names it.
std::string Verdict(const proto::StatusReply& status) {
  std::map<std::string, int> present;  // By role.
  std::map<std::string, int> gone;
  double lost = 0.0;
  bool finished = false;
  for (const proto::RoleStatus& entry : status.roles) {
    const proto::Report& report = entry.report;
    ++(entry.connected ? present : gone)[report.role];
    const auto state = report.facts.find("state");
    finished |=
        report.role == "learner" && state != report.facts.end() && state->second == "finished";
    const auto it = report.figures.find("steps_lost");
    if (it != report.figures.end()) lost += it->second;
  }
  std::string faults;
  for (const auto& [role, count] : gone) {
    faults += fmt::format("not well: {} {}{} gone, stopped or killed or cut off\n", count, role,
                          count == 1 ? " is" : "s are");
  }
  for (const char* const role : {"learner", "actor"}) {
    if (present[role] == 0) faults += fmt::format("not well: no {} is connected\n", role);
  }
  if (lost > 0.0) faults += fmt::format("not well: {:.0f} steps were lost in all\n", lost);
  if (!faults.empty()) return faults;
  return finished ? "all is well, and the run is finished\n" : "all is well\n";
}

}  // namespace

std::string FormatStatus(const proto::StatusReply& status) {
  if (status.roles.empty()) {
    return "the replay server answers, but no process has reported yet; ask again in a few "
           "seconds\n";
  }
  std::string text;
  AddTable(text, status, "replay", "replay server",
           {{"steps", "steps"},
            {"steps/s", "steps_per_s"},
            {"in table", "table_steps"},
            {"batches/s", "batches_per_s"},
            {"held chunks", "held_chunks"},
            {"held samples", "held_samples"},
            {"sessions", "sessions"}});
  AddTable(text, status, "learner", "learner",
           {{"updates", "updates"},
            {"updates/s", "updates_per_s"},
            {"policy", "policy_version"},
            {"policy lag", "policy_lag"},
            {"readers", "readers"},
            {"mean Q", "q_mean"},
            {"time left", kSecondsLeft}});
  AddTable(text, status, "actor", "actor",
           {{"steps made", "steps_made"},
            {"steps/s", "steps_per_s"},
            {"pending", "steps_pending"},
            {"lost", "steps_lost"},
            {"policy", "policy_version"},
            {"episodes", "episodes"},
            {"success", "success_rate"}});
  AddTable(text, status, "evaluator", "evaluator",
           {{"evaluations", "evaluations"},
            {"newest policy", "policy_version"},
            {"scored policy", "scored_version"},
            {"success", "success_rate"}});
  if (status.omitted > 0) {
    text += fmt::format("{} more actors do not fit into the answer\n", status.omitted);
  }
  return text + Verdict(status);
}

}  // namespace slalom::cli
