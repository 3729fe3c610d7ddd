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

/// The lines of curve.csv and of the table on the terminal: how well policies did, by training
/// time.
class Curve {
 public:
  Curve() {
    fmt::print("\n{:>10} {:>12} {:>10} {:>9} {:>17} {:>11}\n", "seconds", "steps", "updates",
               "success", "95 % interval", "traversal");
  }

  void Add(const policy::LoadedPolicy& policy, const eval::Figures& set) {
    const eval::Interval interval = set.success_rate.interval.value_or(eval::Interval{0.0, 1.0});
    const std::string traversal =
        set.traversal_time ? fmt::format("{:.2f}", set.traversal_time->value) : "";
    const std::string seconds = Provenance(policy, "training_s");
    const std::string steps = Provenance(policy, "steps");
    const std::string updates = Provenance(policy, "updates");
    csv_ += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{}\n", seconds, steps, updates,
                        set.success_rate.value, interval.low, interval.high,
                        set.collision_rate.value, set.timeout_rate.value, traversal);
    fmt::print("{:>10} {:>12} {:>10} {:>8.1f}% {:>8.1f}-{:>5.1f} % {:>9} s\n", seconds, steps,
               updates, 100.0 * set.success_rate.value, 100.0 * interval.low, 100.0 * interval.high,
               traversal);
  }

  const std::string& csv() const { return csv_; }

 private:
  std::string csv_ =
      "training_s,steps,updates,success_rate,success_low,success_high,collision_rate,timeout_rate,"
      "traversal_time_s\n";
};

std::vector<fs::path> ListSnapshots(const run::RunDirectory& directory) {
  std::vector<fs::path> paths;
  if (!fs::exists(directory.snapshots())) return paths;
  for (const auto& entry : fs::directory_iterator(directory.snapshots())) {
    if (entry.path().extension() == ".safetensors") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace

void DrawTraining(const run::RunDirectory& directory) {
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

bool ScoreTraining(const run::RunDirectory& directory, const train::RunConfig& config,
                   base::ParallelFor& parallel, std::stop_token stop) {
  const std::string policy_path = directory.policy().string();
  const policy::LoadedPolicy policy = policy::LoadPolicy(directory.policy());
  const auto result = EvaluatePolicy(policy.snapshot, policy_path, config, config.courses.test,
                                     config.courses, parallel, stop);
  if (!result) return false;
  WriteScoredRun(*result, directory.root);
  fmt::print("{}", eval::TextReport(result->evaluation));
  if (const auto snapshots = ListSnapshots(directory); !snapshots.empty()) {
    Curve curve;
    for (const fs::path& path : snapshots) {
      const policy::LoadedPolicy kept = policy::LoadPolicy(path);
      const auto scored = EvaluatePolicy(kept.snapshot, path.string(), config, config.courses.test,
                                         std::nullopt, parallel, stop);
      if (!scored) return false;
      curve.Add(kept, scored->evaluation.summary.set);
    }
    curve.Add(policy, result->evaluation.summary.set);
    base::WriteFileAtomically(directory.curve(), curve.csv());
  }
  const std::string root = directory.root.string();
  const std::string collection =
      config.courses.collection.empty() ? "" : " --collection " + config.courses.collection;
  fmt::print(
      "\npolicy    {0}\n"
      "figures   {1}/evaluation.json, evaluation-courses.csv, metrics.csv\n"
      "pictures  {1}/courses.png (what it drove), {1}/training.svg\n"
      "\nnext\n"
      "  on fresh courses   ./slalom evaluate --policy {0} --courses generated:7:100\n"
      "  one course         ./slalom courses render --courses {2}{3} --course {4} --episodes "
      "{1}/evaluation-tracks.jsonl --output one.svg\n"
      "  train longer       ./slalom train configs/fast.toml\n"
      "  a lifelike drive   ./slalom train configs/lifelike.toml\n",
      policy_path, root, config.courses.test, collection,
      result->evaluation.courses.courses.front()->name);
  return true;
}

}  // namespace slalom::cli
