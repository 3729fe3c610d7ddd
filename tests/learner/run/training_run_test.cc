#include "learner/run/training_run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "learner/run/checkpoint_store.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

/// Updates a second apart, from the last checkpoint on, without a gradient of the actor. Returns
/// whether the run has learned nothing.
bool HasLearnedNothing(RunPlan plan, std::int64_t from, std::int64_t to, double success_rate) {
  double now_s = 0.0;
  TrainingRun run(std::move(plan), TrainingClock([&now_s] {
                    return ClockReading{.wall_s = now_s, .processor_s = now_s};
                  }));
  if (from > 0) {
    EXPECT_TRUE(run.Restore([from](const auto&, const auto&) { return from; }));
    EXPECT_EQ(run.training_s(), static_cast<double>(from));
  }
  run.StartClock();
  for (std::int64_t updates = from; updates <= to; ++updates, now_s += 1.0) {
    run.LookAtClock();
    run.SetProgress(2 * updates, updates);
    MetricsRow row;
    row.success_rate = success_rate;
    row.learning.actor_gradient_norm = 0.0;
    row.learning.critic_gradient_norm = 1.0;
    EXPECT_EQ(run.Log(row).updates_per_s, updates == from ? 0.0 : 1.0);
    if (updates > 0) {
      EXPECT_NEAR(run.SecondsLeft(), 5000.0 - static_cast<double>(updates), 1e-6);
    }
  }
  run.Checkpoint(to, [](const auto&, auto&) {});
  return run.watch().nothing_learned();
}

TEST(TrainingRunTest, EachSessionKnowsWhatTheOnesBeforeHaveSeen) {
  const test::ScratchDirectory scratch;
  for (const double success_rate : {0.0, 0.5}) {
    RunPlan plan;
    plan.directory.root = scratch.path() / std::to_string(success_rate);
    plan.settings.max_steps = 10000;
    EXPECT_FALSE(HasLearnedNothing(plan, 0, 400, success_rate));
    EXPECT_FALSE(HasLearnedNothing(plan, 400, 800, 0.0));
    EXPECT_EQ(HasLearnedNothing(plan, 800, 1200, 0.0), success_rate == 0.0);
    plan.has_goals = false;
    EXPECT_FALSE(HasLearnedNothing(plan, 1200, 1300, 0.0));
  }
}

TEST(TrainingRunTest, RowsAndRatesGoOnAfterARestartAndADamagedCheckpointIsPassedOver) {
  const test::ScratchDirectory scratch;
  RunPlan plan;
  plan.directory.root = scratch.path();
  plan.settings.log_interval = 1.0;
  double now_s = 0.0;
  std::int64_t updates = 0;
  std::vector<std::filesystem::path> checkpoints;
  const auto make = [&] {
    return TrainingRun(plan, TrainingClock([&now_s] {
                         return ClockReading{.wall_s = now_s, .processor_s = now_s};
                       }));
  };
  const auto read = [&](const auto&, const auto&) { return updates; };
  for (int session = 0; session < 2; ++session, now_s += 100.0) {
    TrainingRun run = make();
    EXPECT_EQ(run.Restore(read), session > 0);
    run.OpenLog();
    run.StartClock();
    for (int i = 0; i < 6; ++i) {
      EXPECT_EQ(run.LogDue(), i > 0 && i % 2 == 0);
      if (run.LogDue()) {
        const MetricsRow row = run.Log({});
        EXPECT_EQ(row.steps_per_s, 8.0);
        EXPECT_EQ(row.updates_per_s, 4.0);
        std::ignore = run.Log({});  // It says nothing new.
      }
      now_s += 0.5;
      updates += 2;
      run.LookAtClock();
      run.SetProgress(2 * updates, updates);
    }
    checkpoints.push_back(run.Checkpoint(updates, [](const auto&, auto&) {}));
  }
  const std::string rows = base::ReadFile(plan.directory.metrics());
  EXPECT_EQ(std::ranges::count(rows, '\n'), 1 + 4) << rows;

  const auto damage = [](const std::filesystem::path& checkpoint) {
    std::string state = base::ReadFile(CheckpointFiles{checkpoint}.state());
    ++state[state.find("\"steps\": ") + 9];
    base::WriteFileAtomically(CheckpointFiles{checkpoint}.state(), state);
  };
  for (int i = 0; i < 2; ++i) {
    damage(checkpoints[1]);
    TrainingRun run = make();
    EXPECT_TRUE(run.Restore(read));
    EXPECT_EQ(run.steps(), 24);
    EXPECT_FALSE(std::filesystem::exists(checkpoints[1]));
    run.Checkpoint(updates, [](const auto&, auto&) {});
  }
  damage(checkpoints[1]);
  damage(checkpoints[0]);
  EXPECT_THROW(make().Restore(read), base::Error);
  EXPECT_TRUE(std::filesystem::exists(checkpoints[0])) << "for a look at it";
}

}  // namespace
}  // namespace slalom::run
