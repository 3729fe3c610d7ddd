#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
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
      {"methods", 30, {"TD3", "DDPG", "SAC", "TD3 with a constraint", "MBPO", "TD3 with a model"}},
      {"networks-boxes",
       30,
       {"MLP / 1", "GRU / 4", "transformer / 8", "MLP with a constraint / 1"}},
      {"networks-static", 27, {"MLP / 1", "MLP / 4", "CNN / 8"}},
      {"networks-walls", 27, {"MLP / 1", "GRU / 4", "transformer / 8"}},
      {"planning", 3, {"td3-with-model"}},
      {"prioritized", 6, {"TD3", "prioritized replay"}},
      {"static", 9, {"250 courses", "50 courses", "250 courses, lifelike drive"}},
      {"training-sets", 15, {"5", "250"}},
  };
  std::set<std::string> tested;
  for (const Expected& expected : all) {
    SCOPED_TRACE(expected.plan);
    const Cells cells = Expand(expected.plan);
    EXPECT_EQ(cells.cells.size(), expected.num_cells);
    for (const std::string& row : expected.rows) EXPECT_NE(FindRow(cells, row), nullptr) << row;
    tested.insert(expected.plan);
  }
  for (const auto& file : fs::directory_iterator(kConfigs / "sweeps")) {
    EXPECT_THAT(tested, Contains(file.path().stem().string())) << "has no line in this test";
  }
}

/// The config of a preset with what a plan may change besides: limits, courses and checkpoints.
std::string SettingsOf(train::RunConfig config) {
  config.run = {};
  config.courses = {};
  return config::ToToml(config);
}

std::string SettingsOfPreset(const std::string& preset) {
  train::RunConfig config;
  config::ReadTomlFile(kConfigs / preset, config::ListFields(config));
  return SettingsOf(config);
}

TEST(PlansTest, RowsOfNetworksAreThePresets) {
  const std::map<std::string, std::string> folders = {
      {"static", ""}, {"boxes", ""}, {"walls", "wall/"}};
  for (const auto& [scenario, folder] : folders) {
    const Cells cells = Expand("networks-" + scenario, {"sweep.seeds=[1]"});
    for (const std::string network : {"MLP", "GRU", "CNN", "transformer"}) {
      for (const std::string frames : {"4", "8"}) {
        const std::string row = network + " / " + frames;
        SCOPED_TRACE(scenario + ", " + row);
        std::string name = network;
        std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
        // There are no presets with eight frames among walls: they differ in the frames alone.
        const bool derived = frames == "8" && !folder.empty();
        const Cell* cell = FindRow(cells, row);
        ASSERT_NE(cell, nullptr);
        train::RunConfig config = *cell->config;
        EXPECT_EQ(config.network.history, std::stoi(frames));
        if (derived) config.network.history = 4;
        EXPECT_EQ(SettingsOf(config), SettingsOfPreset("fast/" + folder + "td3-" + name + "-h" +
                                                       (derived ? "4" : frames) + ".toml"));
      }
    }
  }
}

TEST(PlansTest, AmongWallsStandingStillCostsMoreThanBeingHit) {
  const Cells cells = Expand("networks-walls", {"sweep.seeds=[1]"});
  for (const Cell& cell : cells.cells) {
    SCOPED_TRACE(cell.name());
    EXPECT_EQ(cell.config->environment.reward.collision, 1.0);
    EXPECT_EQ(cell.config->environment.reward.slack, 0.02);
    EXPECT_EQ(cell.config->method.learner.gamma, 0.995);
  }
}

TEST(PlansTest, PlansShareCells) {
  const Cells methods = Expand("methods");
  EXPECT_EQ(FindRow(methods, "TD3 with a model")->id, Expand("planning").cells[0].id);
  EXPECT_EQ(FindRow(methods, "TD3")->id, FindRow(Expand("networks-static"), "MLP / 1")->id);
}

TEST(PlansTest, ValidationNeverDrivesTestCourses) {
  const Cells cells =
      Expand("methods", {"sweep.scores=[\"validation\"]", "courses.train=static-train-210"});
  for (const Cell& cell : cells.cells) {
    EXPECT_THAT(ScoreNames(cell), ElementsAre("validation"));
    EXPECT_EQ(cell.num_training_courses, 210);
  }
  EXPECT_THAT(ScoreNames(Expand("methods").cells[0]), ElementsAre("test", "fresh", "lifelike"));
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
