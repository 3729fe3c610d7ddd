#include "learner/run/training_run.h"

#include <gtest/gtest.h>

#include <string>

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

}  // namespace
}  // namespace slalom::run
