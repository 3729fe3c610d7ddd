#include "app/cli/training_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "app/cli/command_line.h"
#include "app/cli/output.h"
#include "app/train/policy_agents.h"
#include "app/train/scoring.h"
#include "app/watch/run_facts.h"
#include "app/watch/run_page.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

std::string Provenance(const policy::LoadedPolicy& policy, const std::string& key) {
  const auto it = policy.metadata.find(key);
  return it == policy.metadata.end() ? "" : it->second;
}

/// The lines of curve.csv and of the table on the terminal: how well policies did, by training
/// time.
class Curve {
 public:
  /// `prints`: whether to print the table. Not if it would only repeat the line above it.
  explicit Curve(bool prints) : prints_(prints) {
    if (!prints) return;
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
    if (!prints_) return;
    fmt::print("{:>10} {:>12} {:>10} {:>8.1f}% {:>8.1f}-{:>5.1f} % {:>9} s\n", seconds, steps,
               updates, 100.0 * set.success_rate.value, 100.0 * interval.low, 100.0 * interval.high,
               traversal);
  }

  const std::string& csv() const { return csv_; }

 private:
  std::string csv_ =
      "training_s,steps,updates,success_rate,success_low,success_high,collision_rate,timeout_rate,"
      "traversal_time_s\n";
  const bool prints_;
};

/// The course with the lowest success rate; the set's first among equals.
std::string WorstCourse(const eval::Summary& summary) {
  return std::ranges::min_element(
             summary.courses, {},
             [](const eval::CourseFigures& course) { return course.figures.success_rate.value; })
      ->name;
}

/// The paths of all files, and the next commands.
std::string NextSteps(const run::RunDirectory& directory, const train::RunConfig& config,
                      const std::string& course, const std::string& train_longer) {
  const std::string root = directory.root.string();
  const std::string policy = directory.policy().string();
  std::vector<std::string> render = TestCoursesOptions(config.courses);
  render.insert(render.begin(), {"courses", "render"});
  render.insert(render.end(), {"--course", course, "--episodes", root + "/evaluation-tracks.jsonl",
                               "--output", root + "/" + course + ".svg"});
  std::string text = fmt::format(
      "\npolicy    {0}\n"
      "scores    {1}/evaluation.json, evaluation-courses.csv, metrics.csv\n"
      "pictures  {1}/courses.png (what it drove), {1}/training.html (how it learned)\n"
      "\nnext\n"
      "  a page with plots  {2}\n"
      "  the worst course   {3}\n"
      "  on fresh courses   {4}\n",
      policy, root, CommandLine({"report", root, "--output", root + "/report"}),
      CommandLine(render),
      CommandLine({"evaluate", "--policy", policy, "--courses", "generated:7:100"}));
  if (!train_longer.empty()) text += fmt::format("  train longer       {}\n", train_longer);
  // The presets are named by paths from the repository's root.
  if (const std::string lifelike = "configs/lifelike.toml"; fs::exists(lifelike)) {
    text += fmt::format("  a lifelike drive   {}\n", CommandLine({"train", lifelike}));
  }
  return text;
}

}  // namespace

std::vector<std::string> TestCoursesOptions(const train::CoursesConfig& courses) {
  if (!courses.inputs.empty()) {
    if (const fs::path copy = courses.CopyOf(courses.test); fs::exists(copy)) {
      return {"--courses", copy.string()};
    }
  }
  std::vector<std::string> options = {"--courses", courses.test};
  if (!courses.collection.empty()) {
    options.insert(options.end(), {"--collection", courses.collection});
  }
  return options;
}

void WriteTrainingPage(const run::RunDirectory& directory) {
  try {
    base::WriteFileAtomically(directory.training_page(),
                              watch::RunPage(directory.root, watch::FactsOf(directory.root)));
  } catch (const base::Error& error) {
    spdlog::warn("{}; the page of the training is left out", error.what());
  }
}

bool ScoreTraining(const run::RunDirectory& directory, const train::RunConfig& config,
                   const std::string& train_longer, base::ParallelFor& parallel,
                   std::stop_token stop) {
  const std::string policy_path = directory.policy().string();
  const policy::LoadedPolicy policy = policy::LoadPolicy(directory.policy());
  const std::string& test = config.courses.test;
  const auto result =
      train::Score(train::PreparePolicy(train::MakeAgentsOf(policy.snapshot, config),
                                        policy.snapshot, policy_path, config, test, config),
                   parallel, stop);
  if (!result) return false;
  fmt::print("{}", eval::TextReport(result->evaluation));
  WriteScores(*result, directory.root);
  const std::vector<fs::path> snapshots = directory.ListSnapshots();
  Curve curve(!snapshots.empty());
  for (const fs::path& path : snapshots) {
    const policy::LoadedPolicy kept = policy::LoadPolicy(path);
    const auto scored =
        train::Score(train::PreparePolicy(train::MakeAgentsOf(kept.snapshot, config), kept.snapshot,
                                          path.string(), config, test, std::nullopt),
                     parallel, stop);
    if (!scored) return false;
    curve.Add(kept, scored->evaluation.summary.set);
  }
  curve.Add(policy, result->evaluation.summary.set);
  base::WriteFileAtomically(directory.curve(), curve.csv());
  WriteTrainingPage(directory);  // Again, with the scores.
  fmt::print("{}",
             NextSteps(directory, config, WorstCourse(result->evaluation.summary), train_longer));
  return true;
}

}  // namespace slalom::cli
