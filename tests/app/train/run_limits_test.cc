#include "app/train/run_limits.h"

#include <gmock/gmock.h>

#include "app/train/run_rules.h"
#include "base/config.h"
#include "base/error.h"

namespace slalom::train {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

/// A run whose first update is due at 1000 + 4 steps and needs 8 environments' windows of 5 frames.
RunConfig EightRobots() {
  RunConfig config;
  config.run.learning_starts = 1000;
  config.run.updates_per_step = 0.25;
  config.run.max_steps = 5000;
  config.actor.num_environments = 8;
  config.network.history = 1;
  config.method.learner.n_step = 4;
  config.replay.capacity = 40;
  return config;
}

TEST(RequireLearnableTest, TheLimitOfStepsMustLieBehindTheFirstUpdate) {
  RunConfig config = EightRobots();
  config.run.max_steps = 1005;
  EXPECT_NO_THROW(RequireLearnable(config));
  config.run.max_steps = 1004;
  EXPECT_THAT([&] { RequireLearnable(config); },
              ThrowsMessage<base::Error>(AllOf(HasSubstr("run.max_steps is 1004"),
                                               HasSubstr("more than 1004"),
                                               HasSubstr("run.learning_starts = 1000"))));
}

TEST(RequireLearnableTest, TheReplayMustHoldAWindowOfEachEnvironment) {
  RunConfig config = EightRobots();
  EXPECT_NO_THROW(RequireLearnable(config));
  config.replay.capacity = 39;
  EXPECT_THAT([&] { RequireLearnable(config); },
              ThrowsMessage<base::Error>(
                  AllOf(HasSubstr("replay.capacity is 39"), HasSubstr("at least 40"))));
}

TEST(LongerLimitTest, DoublesTheLimitThatWasReached) {
  RunConfig config = EightRobots();
  EXPECT_EQ(LongerLimit(config, 5040, 12.0), "run.max_steps=10080");
  config.run.max_seconds = 90.0;
  EXPECT_EQ(LongerLimit(config, 4000, 90.4), "run.max_seconds=180");
  EXPECT_EQ(LongerLimit(config, 5040, 12.0), "run.max_steps=10080");
}

TEST(ExplainNoUpdateTest, ProposesALimitThatIsLongEnough) {
  RunConfig config = EightRobots();
  config.run.max_seconds = 2.0;
  // 100 steps in 2 s: the 1004 of the first update take 20.08 s.
  const NothingLearned slow = ExplainNoUpdate(config, 100, 2.0);
  EXPECT_THAT(slow.reason, AllOf(HasSubstr("run.max_seconds = 2"), HasSubstr("after 100 steps"),
                                 HasSubstr("after 1004"), HasSubstr("run.learning_starts = 1000")));
  EXPECT_EQ(slow.override, "run.max_seconds=41");
  EXPECT_EQ(ExplainNoUpdate(config, 0, 2.0).override, "run.max_seconds=4016");
  config.run.max_seconds = 0.0;
  config.run.max_steps = 500;
  EXPECT_EQ(ExplainNoUpdate(config, 504, 2.0).override, "run.max_steps=2008");
}

TEST(ExplainNoUpdateTest, NamesTheReplayWhereStepsWereNotMissing) {
  EXPECT_THAT(ExplainNoUpdate(EightRobots(), 5000, 20.0).reason, HasSubstr("replay.capacity = 40"));
}

TEST(OverridesForDeterminismTest, ListsAllAtOnceAndTheyAreEnough) {
  RunConfig config = EightRobots();
  config.run.max_steps = 100000000;
  config.run.max_seconds = 90.0;
  const auto overrides = OverridesForDeterminism(config);
  EXPECT_THAT(overrides, ElementsAre("run.max_seconds=0", "run.max_steps=900000"));
  for (const std::string& override : overrides) {
    config::ApplyOverride(override, config::ListFields(config));
  }
  EXPECT_THAT(OverridesForDeterminism(config), IsEmpty());
  EXPECT_NO_THROW(RequireLearnable(config));
}

}  // namespace
}  // namespace slalom::train
