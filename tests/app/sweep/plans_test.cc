#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "base/config.h"

/// The plans in configs/sweeps: each is read and resolved with the built-in courses.

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;

const fs::path kConfigs = fs::path(SLALOM_SOURCE_DIR) / "configs";
const train::Platform kPlatform{.blas_kernel = "k", .processor = "p"};

Cells Expand(const std::string& plan, const std::vector<std::string>& overrides = {}) {
  return ExpandPlan(ReadPlan(kConfigs / "sweeps" / (plan + ".toml"), overrides), kPlatform);
}

/// The files of configs/sweeps that are plans.
std::vector<fs::path> Plans() {
  std::vector<fs::path> plans;
  for (const auto& file : fs::recursive_directory_iterator(kConfigs / "sweeps")) {
    const fs::path name = file.path().filename();
    // A list of plans, and the base of plans.
    if (!file.is_regular_file() || name == "paper.toml" || name == "settings.toml") continue;
    plans.push_back(file.path());
  }
  return plans;
}

const Cell* FindRow(const Cells& cells, const std::string& row) {
  const auto found = std::ranges::find(cells.cells, row, &Cell::row_name);
  return found == cells.cells.end() ? nullptr : &*found;
}

std::vector<std::string> ScoreNames(const Cell& cell) {
  std::vector<std::string> names;
  for (const ScoreTask& score : cell.scores) {
    if (score.snapshot_steps == 0) names.push_back(score.name);
  }
  return names;
}

struct Expected {
  std::string plan;
  std::size_t num_cells;
  std::vector<std::string> rows;  ///< Some of them.
};

TEST(PlansTest, EveryPlanHasItsRows) {
  const std::vector<Expected> all = {
      {"ablations", 21, {"TD3", "without mirror images", "Dyna as published"}},
      {"as-published", 48, {"TD3", "MPC, probabilistic", "TD3, transformer, 8 frames"}},
      {"classical", 4, {"DWA", "TEB", "E-band", "MPPI"}},
      {"guard-original", 6, {"the first command's", "DWA"}},
      {"tracking", 5, {"the first command's", "MPPI", "DWA"}},
      {"localisation", 7, {"the first command's", "MPPI", "DWA"}},
      {"guard", 9, {"the first command's", "MPPI", "MPPI, far map", "TEB", "DWA"}},
      {"moving", 5, {"moving"}},
      {"paper/algorithms", 15, {"TD3 / MLP / 1", "SAC / GRU / 4", "DDPG / Transformer / 4"}},
      {"paper/figure-1", 17, {"RL", "DWA", "E-band"}},
      {"paper/memory", 81, {"MLP / 1", "GRU / 4", "Transformer / 8"}},
      {"paper/models", 42, {"MLP", "Dyna-style deterministic", "MPC probabilistic", "MBPO"}},
      {"paper/physical", 29, {"MLP, 50 courses", "Lagrangian, trained under the profile", "DWA"}},
      {"paper/published-code", 3, {"the paper, done right", "code of March 2022"}},
      {"paper/reward", 24, {"5.0 / 0.0 / 4.0", "20.0 / 1.0 / 1.0"}},
      {"paper/safety", 19, {"MLP", "Lagrangian", "MPC", "DWA", "TEB", "E-band", "MPPI"}},
      {"planning", 3, {"td3-with-model"}},
      {"prioritized", 6, {"TD3", "prioritized replay"}},
      {"robust", 10, {"the first command's", "robust.toml"}},
      {"robust-original", 10, {"the first command's", "robust.toml"}},
      {"static", 9, {"250 courses", "50 courses", "250 courses, lifelike drive"}},
      {"training-sets", 25, {"5", "250"}},
  };
  std::set<std::string> tested;
  for (const Expected& expected : all) {
    SCOPED_TRACE(expected.plan);
    const Cells cells = Expand(expected.plan);
    EXPECT_EQ(cells.cells.size(), expected.num_cells);
    for (const std::string& row : expected.rows) EXPECT_NE(FindRow(cells, row), nullptr) << row;
    tested.insert(expected.plan);
  }
  for (const fs::path& file : Plans()) {
    EXPECT_THAT(tested, Contains(file.lexically_relative(kConfigs / "sweeps").replace_extension()))
        << "has no line in this test";
  }
}

TEST(PlansTest, ThePaperIsAllPlansOfItsFolder) {
  std::set<fs::path> listed;
  for (const fs::path& file : PlanFiles(kConfigs / "sweeps" / "paper.toml")) {
    EXPECT_TRUE(listed.insert(file.lexically_normal()).second) << file;
  }
  for (const fs::path& file : Plans()) {
    if (file.parent_path().filename() == "paper") EXPECT_THAT(listed, Contains(file));
  }
}

TEST(PlansTest, NetworksOfTheMemoryTableDifferInNothingElse) {
  const Cells cells = Expand("paper/memory", {"sweep.seeds=[1]"});
  ASSERT_EQ(cells.cells.size(), 27U);
  const train::RunConfig& first = *cells.cells[0].config;
  for (const Cell& cell : cells.cells) {
    SCOPED_TRACE(cell.name());
    train::RunConfig config = *cell.config;
    EXPECT_EQ(cell.scores.size(), 2U);
    config.network = first.network;
    config.courses = first.courses;
    EXPECT_EQ(config::ToToml(config), config::ToToml(first));
  }
}

TEST(PlansTest, ModelsAreComparedAtOneRatioOfUpdates) {
  for (const Cell& cell : Expand("paper/models").cells) {
    EXPECT_EQ(cell.config->run.updates_per_step, 0.25) << cell.name();
  }
}

TEST(PlansTest, PlansShareCells) {
  const std::string mlp = FindRow(Expand("paper/memory"), "MLP / 1")->id;
  EXPECT_EQ(FindRow(Expand("paper/safety"), "MLP")->id, mlp);
  EXPECT_EQ(FindRow(Expand("training-sets"), "50")->id, mlp);
  EXPECT_EQ(FindRow(Expand("paper/physical"), "MLP, 50 courses")->id, mlp);
  EXPECT_EQ(FindRow(Expand("paper/reward"), "20.0 / 1.0 / 1.0")->id, mlp);
}

TEST(PlansTest, AConstraintTakesThePlaceOfTheCostOfACollision) {
  for (const char* plan : {"paper/safety", "paper/physical"}) {
    for (const Cell& cell : Expand(plan).cells) {
      if (!cell.config) continue;
      const bool constrained =
          cell.config->method.constraint.kind != learner::ConstraintKind::kNone;
      EXPECT_EQ(cell.config->environment.reward.collision, constrained ? 0.0 : 1.0) << cell.name();
    }
  }
}

TEST(PlansTest, PlannersDriveWhatTheirGroupsList) {
  const Cells cells = Expand("classical");
  EXPECT_EQ(cells.cells[0].scores.size(), 8U) << "DWA drives all";
  EXPECT_THAT(ScoreNames(cells.cells[1]), ElementsAre("static-test"));
  EXPECT_THAT(
      ScoreNames(cells.cells[3]),
      ElementsAre("static-test", "boxes", "walls", "real-world-1", "real-world-2", "real-world-3"));
  EXPECT_EQ(cells.cells[0].scores[0].num_episodes, 500);
  EXPECT_EQ(cells.cells[0].scores[1].num_episodes, 600);
}

}  // namespace
}  // namespace slalom::sweep
