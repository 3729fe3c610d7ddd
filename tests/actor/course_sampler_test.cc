#include "actor/course_sampler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "base/error.h"

namespace slalom::actor {
namespace {

using ::testing::UnorderedElementsAre;

constexpr int kFirst = 700;

/// Drives the fresh course that is due: `outcomes` are those of its episodes.
int Measure(CourseSampler& sampler, base::Random& random, const std::vector<bool>& outcomes) {
  std::vector<CourseSampler::Draw> draws;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    do {
      draws.push_back(sampler.Next(random));
      if (draws.back().is_learnable) draws.pop_back();
    } while (draws.size() <= i);
    EXPECT_EQ(draws[i].course, draws[0].course);
  }
  for (std::size_t i = 0; i < outcomes.size(); ++i) sampler.Report(draws[i], outcomes[i]);
  return draws[0].course;
}

std::vector<int> Kept(const CourseSampler& sampler) {
  std::vector<int> kept;
  for (const MeasuredCourse& course : sampler.Save().learnable) kept.push_back(course.course);
  return kept;
}

TEST(CourseSampler, DrawsANamedSetAsASingleNumberWould) {
  CourseSampler sampler({}, 250, false, 0);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    base::Random random(seed);
    base::Random plain(seed);
    const CourseSampler::Draw draw = sampler.Next(random);
    EXPECT_EQ(draw.course, static_cast<int>(plain.UniformInt(250)));
    EXPECT_FALSE(draw.is_learnable);
    EXPECT_EQ(random.state(), plain.state());
  }
}

TEST(CourseSampler, DrivesEachFreshCourseAsOftenAsAsked) {
  CourseSampler sampler({.fresh_episodes = 3}, 0, true, kFirst);
  base::Random random(1);
  for (int i = 0; i < 30; ++i) {
    const CourseSampler::Draw draw = sampler.Next(random);
    EXPECT_EQ(draw.course, kFirst + i / 3);
    sampler.Report(draw, i % 3 == 0);
  }
  EXPECT_EQ(sampler.stats().num_courses, 10);
  sampler.Next(random);
  EXPECT_EQ(sampler.stats().num_courses, 11) << "one that was begun counts";
  EXPECT_NEAR(sampler.stats().mean_success, 1.0 / 3.0, 1e-12);
  EXPECT_EQ(sampler.stats().learnable_share, 1.0);
  EXPECT_THAT(Kept(sampler), ::testing::IsEmpty()) << "sampling is uniform";
}

TEST(CourseSampler, SharesTheDrawsAsAsked) {
  constexpr int kDraws = 20000;
  const SamplingConfig config{.sampling = Sampling::kLearnable,
                              .fresh_share = 0.3,
                              .fresh_episodes = 2,
                              .learnable_share = 0.4};
  CourseSampler sampler(config, 5, true, kFirst);
  base::Random random(2);
  int num_learnable = 0;
  int num_fresh = 0;
  for (int i = 0; i < kDraws; ++i) {
    const CourseSampler::Draw draw = sampler.Next(random);
    num_learnable += draw.is_learnable ? 1 : 0;
    num_fresh += !draw.is_learnable && draw.course >= 5 ? 1 : 0;
    sampler.Report(draw, random.Uniform() < 0.5);
  }
  const auto within = [](double count, double of, double share) {
    return std::abs(count - of * share) < 5.0 * std::sqrt(of * share * (1.0 - share));
  };
  EXPECT_TRUE(within(num_learnable, kDraws, 0.4)) << num_learnable;
  EXPECT_TRUE(within(num_fresh, kDraws - num_learnable, 0.3)) << num_fresh;
}

TEST(CourseSampler, KeepsTheMostLearnableFreshCourses) {
  CourseSampler sampler(
      {.sampling = Sampling::kLearnable, .learnable_share = 0.0, .learnable_courses = 2}, 0, true,
      kFirst);
  base::Random random(3);
  Measure(sampler, random, {true, true, true, true});
  EXPECT_THAT(Kept(sampler), ::testing::IsEmpty()) << "nothing is left to learn there";
  Measure(sampler, random, {false, false, false, false});
  EXPECT_THAT(Kept(sampler), ::testing::IsEmpty()) << "nothing can be learned there yet";
  const int quarter = Measure(sampler, random, {true, false, false, false});
  const int half = Measure(sampler, random, {true, false, false, true});
  EXPECT_THAT(Kept(sampler), UnorderedElementsAre(quarter, half));
  Measure(sampler, random, {true, true, false, true});
  EXPECT_THAT(Kept(sampler), UnorderedElementsAre(quarter, half)) << "no more learnable";
  const int other_half = Measure(sampler, random, {true, true, false, false});
  EXPECT_THAT(Kept(sampler), UnorderedElementsAre(other_half, half));
  EXPECT_NEAR(sampler.stats().mean_success, 12.0 / 24.0, 1e-12);
  EXPECT_NEAR(sampler.stats().learnable_share, 4.0 / 6.0, 1e-12);
}

TEST(CourseSampler, StatsAreThoseOfTheLastThousandFreshCourses) {
  // The first hundred are mastered or a matter of luck; no later one is either.
  CourseSampler sampler({}, 0, true, kFirst);
  base::Random random(3);
  for (int i = 0; i < 1100; ++i) {
    const bool is_early = i < 100;
    Measure(sampler, random, {is_early, is_early, is_early, is_early && i % 2 == 0});
  }
  EXPECT_EQ(sampler.stats().mean_success, 0.0);
  EXPECT_EQ(sampler.stats().learnable_share, 0.0);
}

TEST(CourseSampler, DrawsInProportionToLearnability) {
  // Of two kept courses with p = 1/4 and 1/2, p (1 - p) is 3/16 and 4/16.
  CourseSampler sampler({.sampling = Sampling::kLearnable}, 0, true, kFirst);
  base::Random random(4);
  const int quarter = Measure(sampler, random, {true, false, false, false});
  const int half = Measure(sampler, random, {true, false, false, true});
  std::map<int, int> counts;
  int num_learnable = 0;
  for (int i = 0; i < 20000; ++i) {
    const CourseSampler::Draw draw = sampler.Next(random);
    if (!draw.is_learnable) continue;
    ++counts[draw.course];
    ++num_learnable;
  }
  EXPECT_EQ(counts[quarter] + counts[half], num_learnable);
  EXPECT_NEAR(counts[quarter], num_learnable * 3.0 / 7.0,
              5.0 * std::sqrt(num_learnable * 12.0 / 49.0));
}

TEST(CourseSampler, ForgetsWhatThePolicyWas) {
  // A course that was a matter of luck and is then always mastered is drawn less and less.
  CourseSampler sampler({.sampling = Sampling::kLearnable}, 1, false, 0);
  base::Random random(5);
  double before = 0.25;
  sampler.Report({0, false}, false);
  sampler.Report({0, false}, true);
  for (int i = 0; i < 40; ++i) {
    sampler.Report({0, i % 2 == 0}, true);
    const double now = sampler.Save().named[0].learnability();
    EXPECT_LT(now, before);
    before = now;
  }
  EXPECT_LT(before, 0.01);
}

TEST(CourseSampler, ForgetsWhatThePolicyWasOnKeptCoursesToo) {
  CourseSampler sampler({.sampling = Sampling::kLearnable}, 0, true, kFirst);
  base::Random random(4);
  const int kept = Measure(sampler, random, {true, false, false, true});
  for (int i = 0; i < 40; ++i) sampler.Report({kept, true}, true);
  EXPECT_LT(sampler.Save().learnable.front().learnability(), 0.01);
}

TEST(CourseSampler, ARestoredOneGoesOnAsTheSaved) {
  const SamplingConfig config{.sampling = Sampling::kLearnable, .learnable_courses = 20};
  CourseSampler whole(config, 4, true, kFirst);
  CourseSampler restored(config, 4, true, kFirst);
  base::Random random(6);
  std::vector<CourseSampler::Draw> open;
  const auto drive = [](CourseSampler& sampler, base::Random& by,
                        std::vector<CourseSampler::Draw>& running) {
    running.push_back(sampler.Next(by));
    if (running.size() < 8) return;
    const std::size_t i = by.UniformInt(running.size());
    sampler.Report(running[i], by.Uniform() < 0.6);
    running.erase(running.begin() + static_cast<std::ptrdiff_t>(i));
  };
  for (int i = 0; i < 6000; ++i) drive(whole, random, open);
  base::Random other(7);
  std::vector<CourseSampler::Draw> open_too;
  for (int i = 0; i < 500; ++i) drive(restored, other, open_too);  // Nothing of it may stay.
  restored.Restore(whole.Save());
  EXPECT_EQ(restored.stats().mean_success, whole.stats().mean_success);
  other = random;
  open_too = open;
  for (int i = 0; i < 3000; ++i) {
    drive(whole, random, open);
    drive(restored, other, open_too);
    ASSERT_EQ(open.back().course, open_too.back().course);
    ASSERT_EQ(open.back().is_learnable, open_too.back().is_learnable);
  }
  EXPECT_EQ(restored.stats().num_courses, whole.stats().num_courses);
  EXPECT_EQ(restored.stats().mean_success, whole.stats().mean_success);
  EXPECT_EQ(restored.stats().learnable_share, whole.stats().learnable_share);
  EXPECT_EQ(restored.Save().candidates, whole.Save().candidates);

  CourseSampler of_other_courses(config, 5, true, kFirst);
  EXPECT_THROW(of_other_courses.Restore(whole.Save()), base::Error);
}

}  // namespace
}  // namespace slalom::actor
