#include "app/sweep/sweep_metrics.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "app/sweep/claim.h"
#include "app/sweep/store.h"
#include "base/file.h"
#include "eval/report/report.h"
#include "eval/report/result.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/eval/report/made_evaluation.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kPlan = std::string(test::kSweep) + test::kTinyScore +
                          "[[axis]]\nname = \"courses\"\nkeys = [\"courses.train\"]\n"
                          "values = [\"generated:3:2\", \"generated:3:5\"]\n"
                          "labels = [\"2\", \"5\"]\n";

/// A store that is empty at first, and the metrics of a plan of four cells.
struct Fixture {
  explicit Fixture(const std::string& text = kPlan)
      : plan(ReadPlan(test::WritePlan(scratch.path(), text), {})),
        cells(ExpandPlan(plan, {.blas_kernel = "k", .processor = "p"})),
        metrics(plan, cells, scratch.path(), MakeIdentity()) {}

  static metrics::Identity MakeIdentity() {
    metrics::Identity identity;
    identity.name = "host";
    return identity;
  }

  /// The directory of a cell, which is there.
  CellDirectory directory(std::size_t cell) const {
    CellDirectory directory(scratch.path(), cells.cells.at(cell).id);
    base::MakeDirectories(directory.root());
    return directory;
  }
  void WriteMetrics(std::size_t cell, const std::string& rows) const {
    base::MakeDirectories(directory(cell).run());
    base::WriteFileAtomically(directory(cell).run() / "metrics.csv",
                              "training_s,steps,updates,success_rate\n" + rows);
  }
  /// Scores the cell with five episodes on each course; returns the directory.
  fs::path Score(std::size_t cell, const std::vector<double>& success) const {
    const fs::path at = directory(cell).score(cells.cells.at(cell).scores.at(0));
    eval::WriteReports(testing::MakeEvaluation(success), testing::MakeProvenance("a"), at);
    return at;
  }
  /// The lines that begin with `name`, after a reading.
  std::vector<std::string> Lines(const std::string& name) {
    metrics.Read();
    std::istringstream text(metrics.registry().Text());
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) {
      if (line.starts_with(name)) lines.push_back(line);
    }
    return lines;
  }
  /// A series of a cell: with all labels that cells have, then `more`.
  std::string Series(const std::string& name, std::size_t cell, const std::string& row,
                     const std::string& more = "") const {
    return fmt::format(
        R"({}{{name="host",role="sweep",run="plan",sweep="plan",cell="{}",row="{}",method="td3",)"
        R"(network="mlp",training_courses="{}",seed="{}"{}}})",
        name, cells.cells.at(cell).id, row, row, cells.cells.at(cell).seed, more);
  }

  const test::ScratchDirectory scratch;
  const Plan plan;
  const Cells cells;
  SweepMetrics metrics;
};

TEST(SweepMetricsTest, AnEmptyStoreShowsCellsThatWait) {
  Fixture sweep;
  const auto lines = sweep.Lines("slalom_sweep_cells{");
  EXPECT_EQ(lines.size(), 5U);
  EXPECT_THAT(lines, Contains(HasSubstr(R"(sweep="plan",state="waiting"} 4)")));
  EXPECT_THAT(lines, Contains(HasSubstr(R"(sweep="plan",state="done"} 0)")));
  EXPECT_THAT(sweep.Lines("slalom_sweep_scores{"), Contains(HasSubstr("} 4")));
  EXPECT_THAT(sweep.Lines("slalom_sweep_steps"),
              Contains(sweep.Series("slalom_sweep_steps", 0, "2") + " 0"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_updates"), ::testing::IsEmpty()) << "not known yet";
  EXPECT_THAT(sweep.Lines("slalom_sweep_success_rate"), ::testing::IsEmpty());
}

TEST(SweepMetricsTest, ATrainingShowsItsLastWholeRow) {
  Fixture sweep;
  const auto claim = ClaimTaker().Try(sweep.directory(2).root());
  sweep.WriteMetrics(2, "1.5,100,30,\n2.5,200,60,0.25\n3.5,300,9");
  EXPECT_THAT(sweep.Lines("slalom_sweep_steps"),
              Contains(sweep.Series("slalom_sweep_steps", 2, "5") + " 200"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_updates"),
              Contains(sweep.Series("slalom_sweep_updates", 2, "5") + " 60"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_training_seconds"),
              Contains(sweep.Series("slalom_sweep_training_seconds", 2, "5") + " 2.5"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_training_success_rate"),
              Contains(sweep.Series("slalom_sweep_training_success_rate", 2, "5") + " 0.25"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_training_courses"),
              Contains(sweep.Series("slalom_sweep_training_courses", 2, "5") + " 5"));
  EXPECT_THAT(
      sweep.Lines("slalom_sweep_cell_state"),
      Contains(sweep.Series("slalom_sweep_cell_state", 2, "5", R"(,state="training")") + " 1"));
}

TEST(SweepMetricsTest, StagesCountAsPartOfTheirTraining) {
  Fixture sweep;
  Cells staged = sweep.cells;
  test::AddStages(staged.cells[2]);
  SweepMetrics metrics(sweep.plan, staged, sweep.scratch.path(), Fixture::MakeIdentity());
  const auto write = [&sweep](const fs::path& run, const std::string& row) {
    base::MakeDirectories(run);
    base::WriteFileAtomically(run / "metrics.csv",
                              "training_s,steps,updates,success_rate\n" + row + "\n");
  };
  const fs::path run = sweep.directory(2).run();
  write(run / "stages/first", "1.5,1000,30,0.75");
  write(run / "stages/second", "2,100,40,0.25");
  const auto shows = [&](const std::string& name, const std::string& value) {
    metrics.Read();
    EXPECT_THAT(metrics.registry().Text(),
                HasSubstr(sweep.Series(name, 2, "5") + " " + value + "\n"));
  };
  shows("slalom_sweep_steps", "1100");
  shows("slalom_sweep_updates", "70");
  shows("slalom_sweep_training_seconds", "3.5");
  shows("slalom_sweep_training_success_rate", "0.25");
  write(run, "4,10,5,0.5");
  shows("slalom_sweep_updates", "75");
  shows("slalom_sweep_training_success_rate", "0.5");
}

TEST(SweepMetricsTest, AScoreShowsTheRatesOfItsEvaluation) {
  Fixture sweep;
  WriteTrained(sweep.directory(1), {.steps = 4000, .updates = 35, .training_s = 8.0});
  const eval::Figures figures = eval::ReadResult(sweep.Score(1, {0.2, 0.9})).set;
  ASSERT_GT(figures.num_successes, 0);
  ASSERT_LT(figures.num_successes, figures.num_episodes);
  const std::string of_score = R"(,courses="test",snapshot_steps="0")";
  EXPECT_THAT(sweep.Lines("slalom_sweep_success_rate"),
              ::testing::ElementsAre(
                  fmt::format("{} {}", sweep.Series("slalom_sweep_success_rate", 1, "2", of_score),
                              figures.success_rate.value)));
  EXPECT_THAT(sweep.Lines("slalom_sweep_collision_rate"),
              ::testing::ElementsAre(fmt::format(
                  "{} {}", sweep.Series("slalom_sweep_collision_rate", 1, "2", of_score),
                  figures.collision_rate.value)));
  EXPECT_THAT(sweep.Lines("slalom_sweep_scores_done"), Contains(HasSubstr("} 1")));
  EXPECT_THAT(sweep.Lines("slalom_sweep_cells{"), Contains(HasSubstr(R"(state="done"} 1)")));
}

TEST(SweepMetricsTest, WhatVanishesOrChangesLeavesNoSeriesBehind) {
  Fixture sweep;
  WriteTrained(sweep.directory(0), {.steps = 4000});
  const fs::path score = sweep.Score(0, {0.5});
  EXPECT_EQ(sweep.Lines("slalom_sweep_success_rate").size(), 1U);
  const std::string done =
      sweep.Series("slalom_sweep_cell_state", 0, "2", R"(,state="done")") + " 1";
  EXPECT_THAT(sweep.Lines("slalom_sweep_cell_state"), Contains(done));

  base::WriteFileAtomically(score / "evaluation.json", "{\"format\":");
  fs::last_write_time(score / "evaluation.json",
                      fs::last_write_time(score / "evaluation.json") + std::chrono::seconds(1));
  EXPECT_THAT(sweep.Lines("slalom_sweep_success_rate"), ::testing::IsEmpty()) << "damaged";

  fs::remove_all(sweep.directory(0).root());
  EXPECT_THAT(sweep.Lines("slalom_sweep_cell_state"), Not(Contains(done)));
  EXPECT_EQ(sweep.Lines("slalom_sweep_cell_state").size(), 4U);
  EXPECT_THAT(sweep.Lines("slalom_sweep_steps"),
              Contains(sweep.Series("slalom_sweep_steps", 0, "2") + " 0"));
}

TEST(SweepMetricsTest, AFailureIsShownUntilItIsMended) {
  Fixture sweep;
  WriteFailure(sweep.directory(3), {.what = "no", .log = "end"});
  const std::string failed = sweep.Series("slalom_sweep_failed", 3, "5");
  EXPECT_THAT(sweep.Lines("slalom_sweep_failed"), Contains(failed + " 1"));
  EXPECT_THAT(sweep.Lines("slalom_sweep_cells{"), Contains(HasSubstr(R"(state="failed"} 1)")));
  fs::remove(sweep.directory(3).failed());
  EXPECT_THAT(sweep.Lines("slalom_sweep_failed"), Contains(failed + " 0"));
}

TEST(SweepMetricsTest, FilesAreReadAtMostOnceInAnInterval) {
  Fixture sweep;
  const auto start = std::chrono::steady_clock::now();
  sweep.metrics.Read();
  sweep.WriteMetrics(0, "1,700,1,0.5\n");
  const std::string after = sweep.Series("slalom_sweep_steps", 0, "2") + " 700\n";
  sweep.metrics.Update(start);
  EXPECT_THAT(sweep.metrics.registry().Text(), Not(HasSubstr(after)));
  sweep.metrics.Update(std::chrono::steady_clock::now() + SweepMetrics::kInterval);
  EXPECT_THAT(sweep.metrics.registry().Text(), HasSubstr(after));
}

TEST(SweepMetricsTest, MethodsAndNetworksHaveNames) {
  Cell cell;
  cell.planner = "dwa";
  EXPECT_EQ(MethodName(cell), "dwa");
  EXPECT_EQ(NetworkName(cell), "none");
  cell.config.emplace();
  EXPECT_EQ(MethodName(cell), "td3");
  EXPECT_EQ(NetworkName(cell), "mlp");
  cell.config->network.encoder = nn::EncoderFamily::kGru;
  cell.config->network.history = 4;
  EXPECT_EQ(NetworkName(cell), "gru-h4");
  cell.config->method.constraint.kind = learner::ConstraintKind::kLagrangian;
  EXPECT_EQ(MethodName(cell), "td3-lagrangian");
  cell.config->method.constraint.kind = learner::ConstraintKind::kNone;
  cell.config->method.learner.algorithm = "sac";
  cell.config->method.model.kind = nn::ModelKind::kProbabilistic;
  EXPECT_EQ(MethodName(cell), "sac-model");
  cell.config->method.imagination.kind = learner::ImaginationKind::kMbpo;
  EXPECT_EQ(MethodName(cell), "sac-mbpo");
  cell.config->method.imagination.kind = learner::ImaginationKind::kNone;
  cell.config->mpc.enabled = true;
  EXPECT_EQ(MethodName(cell), "sac-mpc");
}

}  // namespace
}  // namespace slalom::sweep
