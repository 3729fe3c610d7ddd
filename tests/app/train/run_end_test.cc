#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "app/train/trainer.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/checkpoint_store.h"
#include "tests/app/train/small_run.h"
#include "tests/support/scratch_directory.h"

/// When a run begins to count, how it ends, and what it leaves behind.

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

/// A clock that goes forward by 10 ms at each look, and by what the test adds.
struct FakeClock {
  std::shared_ptr<double> now_s = std::make_shared<double>(5000.0);
  run::TrainingClock Make() const {
    return run::TrainingClock([now = now_s] {
      *now += 0.01;
      return run::ClockReading{.wall_s = *now, .processor_s = *now};
    });
  }
};

std::vector<std::string> MetricsLines(const run::RunDirectory& directory) {
  std::istringstream in(base::ReadFile(directory.metrics()));
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Building and loading may take minutes: the limit is of training.
TEST(RunEndTest, TimeBeforeTheTrainingCostsItNothing) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.deterministic = false;
  config.run.max_steps = 100000000;
  config.run.max_seconds = 20.0;
  const run::RunDirectory directory{scratch.path() / "run"};
  for (const bool resume : {false, true}) {
    const FakeClock clock;
    metrics::Registry registry("train", "test");
    Trainer trainer(ResolveForTraining(config, resume), directory, "test", resume, registry,
                    clock.Make());
    const std::int64_t before = trainer.updates();
    *clock.now_s += 3600.0;
    EXPECT_EQ(trainer.Run({}), TrainingEnd::kFinished);
    EXPECT_NEAR(trainer.training_s(), config.run.max_seconds, 0.1);
    EXPECT_GT(trainer.updates(), before);
    config.run.max_seconds = 40.0;
  }
  // The first row after the resume: a rate over the time trained, not over that of loading. A turn
  // of the loop takes 10 ms by this clock, and is 8 steps or an update.
  double rate = -1.0;
  for (const std::string& line : MetricsLines(directory)) {
    std::istringstream row(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (rate < 0.0 && std::atof(cells[0].c_str()) > 20.02) rate = std::stod(cells[4]);
  }
  EXPECT_GT(rate, 10.0);
  EXPECT_LE(rate, 801.0);
}

TEST(RunEndTest, ARunThatEndsBeforeItsFirstUpdateHasLearnedNothingAndGoesOn) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.deterministic = false;
  config.run.max_seconds = 0.2;
  const run::RunDirectory directory{scratch.path() / "run"};
  metrics::Registry registry("train", "test");
  EXPECT_EQ(
      Trainer(ResolveForTraining(config), directory, "test", false, registry, FakeClock().Make())
          .Run({}),
      TrainingEnd::kLearnedNothing);
  EXPECT_FALSE(fs::exists(directory.policy()));
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kLearnedNothing);
  config.run.max_seconds = 0.0;
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished);
}

TEST(RunEndTest, ARunThatCannotLearnIsNotBegun) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.max_steps = config.run.learning_starts;
  EXPECT_THROW(RunOnce(config, {scratch.path() / "run"}), base::Error);
  EXPECT_FALSE(fs::exists(scratch.path() / "run"));
}

TEST(RunEndTest, ANetworkWithoutGradientHasLearnedNothing) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.updates_per_step = 0.25;
  config.run.max_steps = 20000;
  config.method.learner.actor_learning_rate = 1.0;
  config.method.learner.critic_learning_rate = 1.0;
  const run::RunDirectory directory{scratch.path() / "run"};
  for (const bool resume : {false, true}) {
    EXPECT_EQ(RunOnce(config, directory, resume, {}, FakeClock().Make()),
              TrainingEnd::kLearnedNothing);
  }
  EXPECT_FALSE(fs::exists(directory.policy()));
}

std::vector<std::string> FilesOf(const run::RunDirectory& directory) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(directory.root)) {
    if (entry.is_regular_file()) {
      files.push_back(fmt::format("{} {:016x}", entry.path().string(),
                                  base::Checksum(base::ReadFile(entry.path()))));
    }
  }
  std::ranges::sort(files);
  return files;
}

TEST(RunEndTest, AFinishedRunIsLeftAsItIs) {
  const test::ScratchDirectory scratch;
  const RunConfig config = SmallRun();
  const run::RunDirectory directory{scratch.path() / "run"};
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  const auto files = FilesOf(directory);
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kWasFinished);
  EXPECT_EQ(FilesOf(directory), files);
  // A crash came between the last checkpoint and the policy.
  fs::remove(directory.policy());
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kWasFinished);
  EXPECT_EQ(FilesOf(directory), files);
}

std::int64_t BytesOf(const fs::path& directory) {
  std::int64_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(directory)) {
    if (entry.is_regular_file()) bytes += static_cast<std::int64_t>(entry.file_size());
  }
  return bytes;
}

TEST(RunEndTest, AFinishedRunKeepsWhatItsConfigSays) {
  const test::ScratchDirectory scratch;
  RunConfig config = SmallRun();
  config.run.checkpoint_steps = 1000;
  const run::RunDirectory directory{scratch.path() / "run"};
  const auto num_checkpoints = [&] {
    return run::CheckpointStore(directory.checkpoints()).List().size();
  };
  const fs::path replay = directory.checkpoints() / "replay";
  config.run.keep_checkpoints = run::KeepCheckpoints::kAll;
  EXPECT_EQ(RunOnce(config, directory), TrainingEnd::kFinished);
  EXPECT_EQ(num_checkpoints(), 2u);
  const std::int64_t both = BytesOf(replay);
  config.run.keep_checkpoints = run::KeepCheckpoints::kNewest;
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kWasFinished);
  EXPECT_EQ(num_checkpoints(), 1u);
  EXPECT_LT(BytesOf(replay), both);
  config.run.max_steps += 1000;
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kFinished);
  EXPECT_EQ(num_checkpoints(), 1u);
  config.run.keep_checkpoints = run::KeepCheckpoints::kNone;
  EXPECT_EQ(RunOnce(config, directory, true), TrainingEnd::kWasFinished);
  EXPECT_EQ(num_checkpoints(), 0u);
  EXPECT_EQ(BytesOf(directory.checkpoints()), 0);
}

}  // namespace
}  // namespace slalom::train
