#include "replay/rate_limiter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "base/random.h"

namespace slalom::replay {
namespace {

// Against the sentences of the contract, with steps and batches counted one by one.
TEST(RateLimiterTest, AgreesWithCountingOneByOne) {
  int held_inserts = 0, held_samples = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    base::Random random(seed);
    const std::int64_t per_batch = 1 + static_cast<std::int64_t>(random.UniformInt(5));
    const std::int64_t starts = static_cast<std::int64_t>(random.UniformInt(30));
    const std::int64_t ahead = static_cast<std::int64_t>(random.UniformInt(20));
    // Ratios 1/1 ... 1/5: a batch is earned by `per_batch` steps.
    RateLimiter limiter({.updates_per_step = 1.0 / static_cast<double>(per_batch),
                         .learning_starts = starts,
                         .max_ahead_steps = ahead},
                        0);
    std::int64_t steps = 0;
    std::map<std::string, std::int64_t> granted, wants;
    std::map<std::string, bool> present;
    const std::vector<std::string> names = {"a", "b"};
    for (int i = 0; i < 3000; ++i) {
      std::int64_t sum = 0;
      for (const auto& [name, count] : granted) sum += count;
      const std::int64_t allowance = std::max(ahead, per_batch);
      const bool insert_is_due =
          ahead == 0 || steps < starts || steps - starts <= sum * per_batch + allowance;
      ASSERT_EQ(limiter.MayInsert(), insert_is_due) << "seed " << seed << " event " << i;
      ASSERT_EQ(limiter.steps(), steps);
      ASSERT_EQ(limiter.granted(), static_cast<double>(sum));

      const std::string name = names[random.UniformInt(names.size())];
      const double what = random.Uniform();
      if (what < 0.45) {
        if (!insert_is_due) {
          ++held_inserts;
          // Never both: who waits is let through by the other.
          if (present[name] && granted.contains(name)) ASSERT_TRUE(limiter.MaySample(name));
          continue;
        }
        const auto n = static_cast<std::int64_t>(1 + random.UniformInt(4));
        limiter.AddSteps(n);
        steps += n;
      } else if (what < 0.9) {
        limiter.Ask(name, static_cast<std::uint64_t>(wants[name]));
        granted[name] = wants[name];
        present[name] = true;
        sum = 0;
        for (const auto& [other, count] : granted) sum += count;
        const bool due = steps - starts >= (sum + 1) * per_batch;
        ASSERT_EQ(limiter.MaySample(name), due) << "seed " << seed << " event " << i;
        if (due) {
          limiter.Grant(name);
          granted[name] = ++wants[name];
        } else {
          ++held_samples;
        }
      } else if (what < 0.95) {
        limiter.Leave(name);
        present[name] = false;
      } else if (what < 0.96) {
        wants[name] = static_cast<std::int64_t>(random.UniformInt(wants[name] + 1));  // Restart.
      }
    }
  }
  EXPECT_GT(held_samples, 1000);
  EXPECT_GT(held_inserts, 1000);
}

// As in a run in one process, which samples whenever it may.
TEST(RateLimiterTest, AGreedyLearnerHoldsTheRatioWhateverTheChunks) {
  base::Random random(1);
  for (const double ratio : {1.0 / 64, 0.25, 1.0, 3.0}) {
    for (const int kinds : {1, 2}) {
      RateLimiter limiter({.updates_per_step = ratio,
                           .batches_per_update = kinds,
                           .learning_starts = 500,
                           .max_ahead_steps = 0},
                          0);
      limiter.Ask("learner", 0);
      for (int chunk = 0; chunk < 300; ++chunk) {
        limiter.AddSteps(static_cast<std::int64_t>(random.UniformInt(100)));
        while (limiter.MaySample("learner")) limiter.Grant("learner");
        const double earned = ratio * kinds * static_cast<double>(limiter.steps() - 500);
        EXPECT_LE(limiter.granted(), std::max(0.0, earned));
        EXPECT_GT(limiter.granted(), earned - 1.0);
      }
    }
  }
}

// A learner with an old checkpoint meets a new table: it waits for the steps, which may come.
TEST(RateLimiterTest, ACursorFarAheadHoldsNoInsert) {
  RateLimiter limiter({.updates_per_step = 0.25, .learning_starts = 10, .max_ahead_steps = 5}, 0);
  limiter.Ask("learner", 1000);
  for (int i = 0; i < 4010; ++i) {
    ASSERT_FALSE(limiter.MaySample("learner")) << i;
    ASSERT_TRUE(limiter.MayInsert()) << i;
    limiter.AddSteps(1);
  }
  limiter.AddSteps(4);
  EXPECT_TRUE(limiter.MaySample("learner"));
}

TEST(RateLimiterTest, ALearnerThatIsGoneLetsNoMoreIn) {
  RateLimiter limiter({.updates_per_step = 1.0, .learning_starts = 0, .max_ahead_steps = 5}, 0);
  limiter.Ask("learner", 0);
  limiter.Leave("learner");
  int steps = 0;
  for (; limiter.MayInsert(); ++steps) limiter.AddSteps(1);
  EXPECT_EQ(steps, 6);
  limiter.Ask("learner", 3);
  EXPECT_TRUE(limiter.MayInsert());
}

TEST(RateLimiterTest, AStarvedLearnerHoldsNoInsert) {
  RateLimiter limiter({.updates_per_step = 1.0, .learning_starts = 0, .max_ahead_steps = 5}, 100);
  limiter.Ask("learner", 0);
  EXPECT_FALSE(limiter.MayInsert());
  limiter.SetStarved(true);
  EXPECT_TRUE(limiter.MayInsert());
}

TEST(RateLimiterTest, NamesAreBounded) {
  RateLimiter limiter({.updates_per_step = 1.0}, 0);
  for (int i = 0; i < 10000; ++i) limiter.Ask("learner-" + std::to_string(i), 1);
  EXPECT_EQ(limiter.granted(), RateLimiter::kMaxLearners);
}

TEST(RateLimiterTest, CursorsComeBackAndADamagedTextIsRefused) {
  const RateLimiter::Options options{.updates_per_step = 0.5, .max_ahead_steps = 10};
  RateLimiter before(options, 1000);
  before.Ask("a", 300);
  before.Grant("a");
  before.Ask("b.2", 7);
  const std::string text = before.PrintCursors();

  RateLimiter after(options, 600);
  EXPECT_FALSE(after.MayInsert());
  EXPECT_FALSE(after.RestoreCursors(text));
  EXPECT_EQ(after.granted(), 308.0);
  EXPECT_TRUE(after.MayInsert());
  EXPECT_EQ(after.PrintCursors(), text);
  after.Ask("a", 200);  // The learner went back to its checkpoint.
  EXPECT_EQ(after.granted(), 207.0);

  const std::string now = after.PrintCursors();
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] ^= 1;
    EXPECT_TRUE(after.RestoreCursors(damaged)) << i;
    EXPECT_TRUE(after.RestoreCursors(text.substr(0, i))) << i;
  }
  EXPECT_EQ(after.PrintCursors(), now);
  EXPECT_FALSE(after.RestoreCursors(RateLimiter(options, 0).PrintCursors()));
  EXPECT_EQ(after.granted(), 0.0);
}

}  // namespace
}  // namespace slalom::replay
