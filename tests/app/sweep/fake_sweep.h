#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "app/sweep/report/report_content.h"
#include "app/sweep/results.h"
#include "app/sweep/store.h"
#include "tests/support/scratch_directory.h"

namespace slalom::test {

/// A plan, its cells and a store, in which evaluations are what the test says.
class FakeSweep {
 public:
  /// On scores of these names, whose labels are "on NAME".
  FakeSweep(std::vector<std::string> axis_names, const std::vector<std::string>& scores);

  /// Adds a training with the plan's scores, or with that of its column. Its id is
  /// "GROUP-LABELS-SEED", with the column at its end.
  std::size_t AddTraining(const std::vector<std::string>& row, int seed,
                          const std::string& column = "");
  std::size_t AddPlanner(const std::vector<std::string>& row);
  /// Adds a task for each score after so many steps to a training.
  void AddSnapshot(std::size_t cell, std::int64_t steps);

  /// Writes trained.json: 4000 steps, 900 updates.
  void FinishTraining(std::size_t cell, double training_s = 40.0,
                      std::optional<std::int64_t> imagined = std::nullopt);
  void Fail(std::size_t cell, const std::string& what, const std::string& log);
  /// Writes an evaluation: for each course the outcomes of its episodes, such as "SSCT". A success
  /// takes `success_time`, a collision 5 s, and a timeout 80 s.
  void Evaluate(std::size_t cell, const std::string& score,
                const std::vector<std::string>& outcomes, double success_time = 10.0,
                std::int64_t snapshot_steps = 0);
  /// Of the evaluations that follow: how many of their courses the policy was trained on.
  void SetTrainingOverlap(int num_courses) { training_overlap_ = num_courses; }

  /// A file of the report.
  std::string Report(const std::string& file) const;

  const sweep::Cell& cell(std::size_t index) const { return cells.cells[index]; }
  std::filesystem::path store() const { return scratch_->path(); }
  sweep::ReportContent Content() const { return sweep::MakeContent(plan, cells, store()); }
  sweep::SweepResults Results() const { return sweep::CollectResults(plan, cells, store()); }

  sweep::Plan plan;
  sweep::Cells cells;

 private:
  std::size_t Add(sweep::Cell cell);
  const sweep::ScoreTask& Task(std::size_t cell, const std::string& score,
                               std::int64_t snapshot_steps) const;

  int training_overlap_ = 0;
  std::unique_ptr<ScratchDirectory> scratch_ = std::make_unique<ScratchDirectory>();
};

/// Three rows, 5, 10 and 50, and the scores "test" and "training": row 5 is complete, of row 10 one
/// seed is there, one failed and one waits, and of row 50 nothing is there. The paper has numbers.
FakeSweep MakeTrainingSets();

/// MLP, GRU and DWA over H = 1 and 4 on the scores "static" and "walls"; the planner has no H.
FakeSweep MakeArchitectures();

}  // namespace slalom::test
