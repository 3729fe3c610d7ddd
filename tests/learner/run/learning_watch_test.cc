#include "learner/run/learning_watch.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace slalom::run {
namespace {

using testing::HasSubstr;

/// A row of a run that learns: 100 updates and 20 episodes after the one before.
MetricsRow Healthy(int row) {
  MetricsRow metrics;
  metrics.updates = 100 * row;
  metrics.episodes = 500 + 20 * row;  // The first are of earlier sessions.
  metrics.success_rate = 0.1;
  metrics.learning.actor_gradient_norm = 1e-12;
  metrics.learning.critic_gradient_norm = 2.0;
  return metrics;
}

TEST(LearningWatchTest, SaysNothingOfARunThatLearns) {
  LearningWatch watch;
  for (int row = 0; row <= 100; ++row) {
    EXPECT_EQ(watch.Observe(Healthy(row), row / 100.0), std::nullopt);
  }
  EXPECT_EQ(watch.fault(), "");
  EXPECT_FALSE(watch.nothing_learned());
}

TEST(LearningWatchTest, WarnsOnceOfAnActorWithoutAGradient) {
  LearningWatch watch;
  int warnings = 0;
  for (int row = 0; row <= 30; ++row) {
    MetricsRow metrics = Healthy(row);
    metrics.success_rate = 0.0;
    metrics.learning.actor_gradient_norm = 0.0;
    const auto warning = watch.Observe(metrics, row / 100.0);
    if (!warning) continue;
    ++warnings;
    EXPECT_EQ(row, LearningWatch::kStillUpdates / 100);
    EXPECT_THAT(*warning, HasSubstr("learner.actor_learning_rate"));
  }
  EXPECT_EQ(warnings, 1);
  EXPECT_TRUE(watch.nothing_learned());
  EXPECT_THAT(watch.fault(), HasSubstr("3000 updates"));
}

TEST(LearningWatchTest, NamesTheCritics) {
  LearningWatch watch;
  for (int row = 0; row <= 10; ++row) {
    MetricsRow metrics = Healthy(row);
    metrics.learning.critic_gradient_norm = 0.0;
    watch.Observe(metrics, 0.1);
  }
  EXPECT_THAT(watch.fault(), HasSubstr("learner.critic_learning_rate"));
  EXPECT_FALSE(watch.nothing_learned()) << "an episode has reached its goal";
}

// A slow run logs rows of one update, and the actor learns in every second one only.
TEST(LearningWatchTest, RowsWithoutAnActorUpdateSayNothing) {
  for (const bool still : {false, true}) {
    LearningWatch watch;
    for (int row = 0; row <= 5000; ++row) {
      MetricsRow metrics = Healthy(row);
      metrics.updates = row;
      metrics.learning.actor_gradient_norm = still ? 0.0 : 0.3;
      if (row % 2 == 1) metrics.learning.actor_gradient_norm = std::nan("");
      watch.Observe(metrics, 0.1);
    }
    EXPECT_EQ(watch.fault().empty(), !still) << watch.fault();
  }
}

TEST(LearningWatchTest, ANetworkThatWakesUpIsNoFaultAnyMore) {
  LearningWatch watch;
  for (int row = 0; row <= 20; ++row) {
    MetricsRow metrics = Healthy(row);
    metrics.learning.actor_gradient_norm = 0.0;
    watch.Observe(metrics, 0.1);
  }
  EXPECT_NE(watch.fault(), "");
  watch.Observe(Healthy(21), 0.1);
  EXPECT_EQ(watch.fault(), "");
}

TEST(LearningWatchTest, WarnsHalfwayThatNoEpisodeReachedItsGoal) {
  LearningWatch watch;
  for (int row = 0; row <= 100; ++row) {
    MetricsRow metrics = Healthy(row);
    metrics.success_rate = row < 5 ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    const auto warning = watch.Observe(metrics, row / 100.0);
    EXPECT_EQ(warning.has_value(), row == 50);
  }
  EXPECT_THAT(watch.fault(), HasSubstr("none of 2000 training episodes"));
  EXPECT_FALSE(watch.nothing_learned()) << "a slow start looks the same";
}

// Nobody knows what an episode without a goal has achieved, also after a restart.
TEST(LearningWatchTest, WithoutGoalsOnlyStillNetworksAreAFault) {
  for (const bool still : {false, true}) {
    LearningWatch watch(/*has_goals=*/false);
    for (int row = 0; row <= 100; ++row) {
      if (row == 40) watch = LearningWatch(false, {0, 0, 0});
      MetricsRow metrics = Healthy(row);
      metrics.success_rate = 0.0;
      if (still) metrics.learning.critic_gradient_norm = 0.0;
      (void)watch.Observe(metrics, row / 100.0);
    }
    EXPECT_EQ(watch.fault().empty(), !still);
    EXPECT_FALSE(watch.nothing_learned());
  }
}

TEST(LearningWatchTest, FewEpisodesShowNothing) {
  LearningWatch watch;
  for (int row = 0; row <= 9; ++row) {
    MetricsRow metrics = Healthy(row);
    metrics.success_rate = 0.0;
    EXPECT_EQ(watch.Observe(metrics, 0.9), std::nullopt);
  }
}

}  // namespace
}  // namespace slalom::run
