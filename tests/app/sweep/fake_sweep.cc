#include "tests/app/sweep/fake_sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include "app/sweep/report/report.h"
#include "base/file.h"
#include "eval/evaluation.h"
#include "eval/report/report.h"

namespace slalom::test {
namespace {

eval::EpisodeRecord MakeRecord(int course, int episode, char letter, double success_time,
                               double step) {
  eval::EpisodeRecord record;
  record.course = course;
  record.episode = episode;
  record.outcome = letter == 'S'   ? env::Outcome::kSuccess
                   : letter == 'C' ? env::Outcome::kCollision
                                   : env::Outcome::kTimeout;
  const double time = letter == 'S' ? success_time : letter == 'C' ? 5.0 : 80.0;
  record.num_steps = static_cast<int>(std::lround(time / step));
  return record;
}

eval::Evaluation MakeEvaluation(const std::vector<std::string>& outcomes, double success_time) {
  eval::Evaluation evaluation;
  evaluation.task = eval::ResolveEvaluation({}, {}, {"made", {}});
  evaluation.task.episodes_per_course = static_cast<int>(outcomes.front().size());
  const double step = evaluation.task.environment.episode.step;
  for (std::size_t c = 0; c < outcomes.size(); ++c) {
    auto course = std::make_shared<sim::Course>();
    course->name = "course-" + std::to_string(c);
    course->goal_W = {10.0, 0.0};
    course->bounds = {{-1.0, -5.0}, {11.0, 5.0}};
    evaluation.task.courses.courses.push_back(std::move(course));
    for (std::size_t k = 0; k < outcomes[c].size(); ++k) {
      evaluation.episodes.records.push_back(
          MakeRecord(static_cast<int>(c), static_cast<int>(k), outcomes[c][k], success_time, step));
    }
  }
  evaluation.summary =
      eval::Summarise(evaluation.episodes.records, evaluation.task.courses, step, 80.0);
  return evaluation;
}

}  // namespace

FakeSweep::FakeSweep(std::vector<std::string> axis_names, const std::vector<std::string>& scores) {
  plan.sweep.name = "fake";
  plan.sweep.title = "A <fake> sweep";
  plan.file = "plans/fake.toml";
  plan.budget.steps = 4000;
  cells.axis_names = std::move(axis_names);
  for (const std::string& name : scores) {
    sweep::Score score;
    score.name = name;
    score.label = "on " + name;
    score.courses = "made-" + name;
    plan.scores.push_back(std::move(score));
  }
}

std::size_t FakeSweep::AddTraining(const std::vector<std::string>& row, int seed,
                                   const std::string& column) {
  sweep::Cell cell;
  cell.row = row;
  cell.column = column;
  cell.seed = seed;
  cell.config = train::ResolvedRun{};
  cell.config->run.max_steps = 4000;
  cell.id = fmt::format("all-{}-{}{}", fmt::join(row, "-"), seed, column);
  return Add(std::move(cell));
}

std::size_t FakeSweep::AddPlanner(const std::vector<std::string>& row) {
  sweep::Cell cell;
  cell.row = row;
  cell.planner = "dwa";
  cell.id = fmt::format("all-{}", fmt::join(row, "-"));
  return Add(std::move(cell));
}

std::size_t FakeSweep::Add(sweep::Cell cell) {
  cell.group = "all";
  cell.friction = "cone";
  for (const sweep::Score& score : plan.scores) {
    if (!cell.column.empty() && score.name != cell.column) continue;
    sweep::ScoreTask task;
    task.name = score.name;
    task.digest = score.name + "-0";
    cell.scores.push_back(std::move(task));
  }
  base::MakeDirectories(sweep::CellDirectory(store(), cell.id).root());
  cells.cells.push_back(std::move(cell));
  return cells.cells.size() - 1;
}

void FakeSweep::AddSnapshot(std::size_t cell, std::int64_t steps) {
  for (const sweep::Score& score : plan.scores) {
    sweep::ScoreTask task;
    task.name = score.name;
    task.digest = fmt::format("{}-{}", score.name, steps);
    task.snapshot_steps = steps;
    cells.cells[cell].scores.push_back(std::move(task));
  }
}

void FakeSweep::FinishTraining(std::size_t index, double training_s,
                               std::optional<std::int64_t> imagined) {
  sweep::TrainedCell trained;
  trained.steps = 4000;
  trained.updates = 900;
  trained.imagined = imagined;
  trained.training_s = training_s;
  trained.host = "node-1";
  trained.commit = "abc123";
  trained.at_once = 2;
  WriteTrained(sweep::CellDirectory(store(), cell(index).id), trained);
}

void FakeSweep::Fail(std::size_t index, const std::string& what, const std::string& log) {
  sweep::CellFailure failure;
  failure.what = what;
  failure.log = log;
  WriteFailure(sweep::CellDirectory(store(), cell(index).id), failure);
}

const sweep::ScoreTask& FakeSweep::Task(std::size_t index, const std::string& score,
                                        std::int64_t snapshot_steps) const {
  for (const sweep::ScoreTask& task : cell(index).scores) {
    if (task.name == score && task.snapshot_steps == snapshot_steps) return task;
  }
  throw std::logic_error("the cell has no such task");
}

void FakeSweep::Evaluate(std::size_t index, const std::string& score,
                         const std::vector<std::string>& outcomes, double success_time,
                         std::int64_t snapshot_steps) {
  eval::Provenance provenance;
  provenance.agent = cell(index).name();
  provenance.kind = cell(index).planner.empty() ? "policy" : "planner";
  provenance.course_set = "made";
  provenance.commit = "abc123";
  eval::Evaluation evaluation = MakeEvaluation(outcomes, success_time);
  evaluation.training_overlap = eval::TrainingOverlap{
      training_overlap_, static_cast<int>(outcomes.size()), "static-train-50"};
  eval::WriteReports(
      evaluation, provenance,
      sweep::CellDirectory(store(), cell(index).id).score(Task(index, score, snapshot_steps)));
}

std::string FakeSweep::Report(const std::string& file) const {
  WriteSweepReport(Content(), store());
  return base::ReadFile(sweep::PlanDirectory(store(), plan.sweep.name) / file);
}

FakeSweep MakeTrainingSets() {
  FakeSweep fake({"training courses"}, {"test", "training"});
  for (const char* row : {"5", "10", "50"}) {
    for (const int seed : {1, 2, 3}) {
      const std::size_t cell = fake.AddTraining({row}, seed);
      if (row == std::string("5") || (row == std::string("10") && seed == 1)) {
        fake.FinishTraining(cell, 30.0 + 10.0 * seed);
      }
    }
  }
  fake.Evaluate(0, "test", {"SSSSC", "SSSST", "SCCCC", "SCCCT"}, 10.0);  // 10 of 20
  fake.Evaluate(1, "test", {"SSSSS", "SSSST", "SSCCC", "SCCCT"}, 12.0);  // 12
  fake.Evaluate(2, "test", {"SSSSS", "SSSSS", "SSSCC", "SCCCT"}, 14.0);  // 14
  fake.Evaluate(3, "test", {"SSSSS", "SSSSS", "SSSSC", "SSSST"}, 10.0);  // 18
  for (const std::size_t cell : {0, 1, 2, 3}) fake.Evaluate(cell, "training", {"SSSSS", "SSSSC"});
  fake.Fail(4, "slalom train ended with 1 <three times>", "no space left\non the device");
  sweep::Reference reference;
  reference.source = "the paper";
  reference.score = "test";
  reference.rows = {"5", "10", "50"};
  reference.values = {0.43, 0.5, 0.65};
  reference.deviations = {0.02, 0.03, 0.04};
  fake.plan.references.push_back(reference);
  return fake;
}

FakeSweep MakeArchitectures() {
  FakeSweep fake({"method", "H"}, {"static", "walls"});
  const std::vector<std::string> few = {"SSC", "SCC"};   // 3 of 6
  const std::vector<std::string> many = {"SSS", "SSC"};  // 5 of 6
  for (const char* method : {"MLP", "GRU"}) {
    for (const char* history : {"1", "4"}) {
      if (method == std::string("GRU") && history == std::string("1")) continue;
      for (const int seed : {1, 2}) {
        const std::size_t cell = fake.AddTraining({method, history}, seed);
        fake.FinishTraining(cell);
        fake.Evaluate(cell, "static", method == std::string("GRU") ? many : few);
        fake.Evaluate(cell, "walls", seed == 1 ? few : many);
      }
    }
  }
  const std::size_t planner = fake.AddPlanner({"DWA"});
  fake.Evaluate(planner, "static", few);
  fake.Evaluate(planner, "walls", many);
  sweep::Reference reference;
  reference.source = "the paper";
  reference.score = "static";
  reference.rows = {"MLP / 1", "MLP / 4"};
  reference.values = {0.65, 0.57};
  reference.deviations = {0.04, 0.07};
  fake.plan.references.push_back(reference);
  return fake;
}

}  // namespace slalom::test
