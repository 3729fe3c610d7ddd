#include "app/sweep/sweep_metrics.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <system_error>
#include <utility>

#include "app/train/resolved_run.h"
#include "base/error.h"
#include "base/file.h"
#include "eval/report/result.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"
#include "metrics/catalogue.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using metrics::Sample;
using Labels = std::vector<std::string>;

constexpr std::array kStates = {CellState::kWaiting, CellState::kTraining, CellState::kScoring,
                                CellState::kDone, CellState::kFailed};

metrics::Identity Complete(metrics::Identity identity, const std::string& sweep) {
  identity.role = "sweep";
  identity.run = sweep;
  return identity;
}

Labels With(Labels labels, std::string value) {
  labels.push_back(std::move(value));
  return labels;
}

/// Labels that every metric of the cell has.
Labels LabelsOf(const std::string& sweep, const Cell& cell) {
  return {sweep,
          cell.id,
          cell.training_name(),
          MethodName(cell),
          NetworkName(cell),
          fmt::format("{}", cell.num_training_courses),
          fmt::format("{}", cell.seed)};
}

}  // namespace

std::string MethodName(const Cell& cell) {
  if (!cell.config) return cell.planner;
  const learner::MethodConfig& method = cell.config->method;
  std::string name = method.learner.algorithm;
  const bool is_constrained = method.constraint.kind != learner::ConstraintKind::kNone;
  if (is_constrained) name += fmt::format("-{}", base::EnumName(method.constraint.kind));
  const bool imagines = method.imagination.kind != learner::ImaginationKind::kNone;
  if (imagines) name += fmt::format("-{}", base::EnumName(method.imagination.kind));
  if (cell.config->mpc.enabled) name += "-mpc";
  const bool model_is_used = imagines || cell.config->mpc.enabled;
  if (method.model.kind != nn::ModelKind::kNone && !model_is_used) name += "-model";
  return name;
}

std::string NetworkName(const Cell& cell) {
  if (!cell.config) return "none";
  const nn::NetworkConfig& network = cell.config->network;
  const std::string encoder(base::EnumName(network.encoder));
  return network.history == 1 ? encoder : fmt::format("{}-h{}", encoder, network.history);
}

SweepMetrics::SweepMetrics(const Plan& plan, Cells cells, fs::path store,
                           metrics::Identity identity)
    : name_(plan.sweep.name),
      cells_(std::move(cells)),
      store_(std::move(store)),
      registry_(Complete(std::move(identity), name_)) {
  Read();
}

void SweepMetrics::Update(std::chrono::steady_clock::time_point now) {
  if (now - last_reading_ >= kInterval) Read();
}

void SweepMetrics::Read() {
  std::vector<Sample> samples;
  std::map<CellState, int> counts;
  std::size_t num_scores = 0;
  int num_scores_done = 0;
  for (const Cell& cell : cells_.cells) {
    const CellStatus status = ReadCellStatus(store_, cell);
    ++counts[status.state];
    num_scores += cell.scores.size();
    num_scores_done += status.num_scores_done;
    AddCell(cell, status, samples);
  }
  for (const CellState state : kStates) {
    samples.push_back({&metrics::kSweepCells,
                       {name_, std::string(ToString(state))},
                       static_cast<double>(counts[state])});
  }
  samples.push_back({&metrics::kSweepScores, {name_}, static_cast<double>(num_scores)});
  samples.push_back({&metrics::kSweepScoresDone, {name_}, static_cast<double>(num_scores_done)});
  registry_.Replace(samples);
  last_reading_ = std::chrono::steady_clock::now();
}

void SweepMetrics::AddCell(const Cell& cell, const CellStatus& status,
                           std::vector<Sample>& samples) {
  const Labels labels = LabelsOf(name_, cell);
  const CellDirectory directory(store_, cell.id);
  const auto show = [&samples](const metrics::Spec& spec, const Labels& values, double value) {
    if (!std::isnan(value)) samples.push_back({&spec, values, value});
  };
  show(metrics::kSweepCellState, With(labels, std::string(ToString(status.state))), 1.0);
  show(metrics::kSweepFailed, labels, status.failure ? 1.0 : 0.0);
  if (cell.config) {
    double updates = 0.0, training_s = 0.0, success_rate = std::nan("");
    bool has_rows = false;
    for (const fs::path& run : train::RunsOf(*cell.config, directory.run())) {
      const run::MetricsTable rows = run::ReadLastMetrics(run::RunDirectory{run}.metrics());
      if (rows.num_rows() == 0) continue;
      has_rows = true;
      updates += rows.Last("updates");
      training_s += rows.Last("training_s");
      success_rate = rows.Last("success_rate");
    }
    show(metrics::kSweepSteps, labels, static_cast<double>(status.steps));
    show(metrics::kSweepUpdates, labels, has_rows ? updates : std::nan(""));
    show(metrics::kSweepTrainingSeconds, labels, has_rows ? training_s : std::nan(""));
    show(metrics::kSweepTrainingSuccessRate, labels, success_rate);
    show(metrics::kSweepTrainingCourses, labels, static_cast<double>(cell.num_training_courses));
  }
  for (const ScoreTask& task : cell.scores) {
    const auto score = ReadScore(directory.score(task) / eval::kEvaluationFile);
    if (!score) continue;
    const Labels of_score = With(With(labels, task.name), fmt::format("{}", task.snapshot_steps));
    show(metrics::kSweepSuccessRate, of_score, score->success_rate);
    show(metrics::kSweepCollisionRate, of_score, score->collision_rate);
  }
}

std::optional<SweepMetrics::Score> SweepMetrics::ReadScore(const fs::path& file) {
  std::error_code error;
  const fs::file_time_type written = fs::last_write_time(file, error);
  if (error) return std::nullopt;
  if (const auto known = scores_.find(file); known != scores_.end()) {
    if (known->second.written == written) return known->second.score;
  }
  std::optional<Score> score;
  try {
    const eval::Figures figures = eval::ParseResult(base::ReadFile(file), file.string()).result.set;
    score = {.success_rate = figures.success_rate.value,
             .collision_rate = figures.collision_rate.value};
  } catch (const base::Error&) {  // It counts as not there; `slalom report` says what is wrong.
  }
  scores_[file] = {written, score};
  return score;
}

}  // namespace slalom::sweep
