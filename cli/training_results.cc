#include "cli/training_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "cli/evaluate_policy.h"
#include "train/line_plot.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> SplitCells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

double Number(const std::string& cell) {
  return cell.empty() ? std::numeric_limits<double>::quiet_NaN() : std::stod(cell);
}

std::string Provenance(const policy::LoadedPolicy& policy, const std::string& key) {
  const auto it = policy.metadata.find(key);
  return it == policy.metadata.end() ? "" : it->second;
}

/// Scores every snapshot of the run; false: stopped first.
bool ScoreSnapshots(const train::RunDirectory& directory, const train::RunConfig& config,
                    base::ParallelFor& parallel, std::stop_token stop) {
  if (!fs::exists(directory.snapshots())) return true;
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(directory.snapshots())) {
    if (entry.path().extension() == ".safetensors") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  std::string csv =
      "training_s,steps,updates,success_rate,success_low,success_high,collision_rate,timeout_rate,"
      "traversal_time_s\n";
  fmt::print("\n{:>10} {:>12} {:>10} {:>9} {:>17} {:>11}\n", "seconds", "steps", "updates",
             "success", "95 % interval", "traversal");
  for (const fs::path& path : paths) {
    const policy::LoadedPolicy policy = policy::LoadPolicy(path);
    const auto result =
        EvaluatePolicy(policy.snapshot, path.string(), config, config.courses.test, parallel, stop);
    if (!result) return false;
    const eval::Figures& set = result->evaluation.summary.set;
    const eval::Interval interval = set.success_rate.interval.value_or(eval::Interval{0.0, 1.0});
    const std::string traversal =
        set.traversal_time ? fmt::format("{:.2f}", set.traversal_time->value) : "";
    csv += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{}\n",
                       Provenance(policy, "training_s"), Provenance(policy, "steps"),
                       Provenance(policy, "updates"), set.success_rate.value, interval.low,
                       interval.high, set.collision_rate.value, set.timeout_rate.value, traversal);
    fmt::print("{:>10} {:>12} {:>10} {:>8.1f}% {:>8.1f}-{:>5.1f} % {:>9} s\n",
               Provenance(policy, "training_s"), Provenance(policy, "steps"),
               Provenance(policy, "updates"), 100.0 * set.success_rate.value, 100.0 * interval.low,
               100.0 * interval.high, traversal);
  }
  base::WriteFileAtomically(directory.curve(), csv);
  return true;
}

}  // namespace

void DrawTraining(const train::RunDirectory& directory) {
  std::istringstream lines(base::ReadFile(directory.metrics()));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> header = SplitCells(line);
  const auto column = [&header](const char* name) {
    return static_cast<std::size_t>(std::find(header.begin(), header.end(), name) - header.begin());
  };
  train::PlotSeries success{"success", "#2a7f3f", {}, {}};
  train::PlotSeries collision{"collision", "#c0392b", {}, {}};
  train::PlotSeries timeout{"timeout", "#b7791f", {}, {}};
  const std::size_t seconds = column("training_s");
  while (std::getline(lines, line)) {
    const std::vector<std::string> cells = SplitCells(line);
    if (cells.size() + 1 < header.size()) continue;
    const auto add = [&](train::PlotSeries& series, const char* name) {
      series.x.push_back(Number(cells[seconds]));
      series.y.push_back(Number(cells[column(name)]));
    };
    add(success, "success_rate");
    add(collision, "collision_rate");
    add(timeout, "timeout_rate");
  }
  base::WriteFileAtomically(
      directory.training_picture(),
      train::DrawRatePlot("Training episodes, with exploration noise", "training time [s]",
                          {success, collision, timeout}));
}

bool ScoreTraining(const train::RunDirectory& directory, const train::RunConfig& config,
                   base::ParallelFor& parallel, std::stop_token stop) {
  const std::string policy_path = directory.policy().string();
  const policy::LoadedPolicy policy = policy::LoadPolicy(directory.policy());
  const auto result =
      EvaluatePolicy(policy.snapshot, policy_path, config, config.courses.test, parallel, stop);
  if (!result) return false;
  WriteEvaluation(*result, directory.root);
  fmt::print("{}", eval::TextReport(result->evaluation));
  if (!ScoreSnapshots(directory, config, parallel, stop)) return false;
  const std::string root = directory.root.string();
  fmt::print(
      "\npolicy    {0}\n"
      "figures   {1}/evaluation.json, evaluation-courses.csv, metrics.csv\n"
      "pictures  {1}/courses.png (what it drove), {1}/training.svg\n"
      "\nnext\n"
      "  on fresh courses   ./slalom evaluate --policy {0} --courses generated:7:100\n"
      "  one course         ./slalom courses render --courses {2} --episodes "
      "{1}/evaluation-tracks.jsonl "
      "--output sheet.svg\n"
      "  train longer       ./slalom train configs/fast.toml\n",
      policy_path, root, config.courses.test);
  return true;
}

}  // namespace slalom::cli
