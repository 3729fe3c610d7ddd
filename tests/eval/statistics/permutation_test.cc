#include "eval/statistics/permutation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace slalom::eval {
namespace {

TEST(SignFlipPValue, MatchesHandCountedCases) {
  // Of the eight sign patterns of 1, 2, 3 only +++ and --- come to 6.
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{1.0, 2.0, 3.0}), 2.0 / 8.0);
  // 4 or more by size: +++ (6), -++ (4) and their opposites.
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{-1.0, 2.0, 3.0}), 4.0 / 8.0);
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{1.0, 0.0, 2.0, 3.0, 0.0}), 2.0 / 8.0);
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{0.0, 0.0}), 1.0);
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{0.7}), 1.0);
  EXPECT_DOUBLE_EQ(SignFlipPValue(std::vector{0.5, -0.5}), 1.0);
}

// Differences of rates are multiples of a tenth that no double holds exactly; permutations that
// come to the same must count as the same.
TEST(SignFlipPValue, CountsTiesInSpiteOfRounding) {
  std::vector<double> tenths;
  std::vector<double> whole;
  base::Random random(5);
  for (int k = 0; k < 14; ++k) {
    const int number = static_cast<int>(random.UniformInt(7)) - 2;
    whole.push_back(number);
    tenths.push_back((0.3 + number * 0.1) - 0.3);
  }
  EXPECT_DOUBLE_EQ(SignFlipPValue(tenths), SignFlipPValue(whole));
}

std::vector<double> Normals(base::Random& random, int count, double shift) {
  std::vector<double> numbers;
  for (int k = 0; k < count; ++k) numbers.push_back(shift + random.Normal());
  return numbers;
}

TEST(SignFlipPValue, DrawsWhatItCannotEnumerate) {
  base::Random random(2);
  const std::vector<double> differences = Normals(random, 15, 0.4);
  const double exact = SignFlipPValue(differences);
  const double drawn = SignFlipPValue(differences, {.max_exact = 1, .num_samples = 50000});
  // Five standard errors of a share of 50000.
  EXPECT_NEAR(drawn, exact, 5.0 * std::sqrt(exact * (1.0 - exact) / 50000.0) + 2e-5);
  EXPECT_NE(drawn, exact);
  // Never 0: (1 + 0) / (1 + 999).
  const std::vector<double> clear(40, 1.0);
  EXPECT_DOUBLE_EQ(SignFlipPValue(clear, {.num_samples = 999}), 0.001);
}

/// The largest distance of the p-values' distribution from the uniform one.
double DistanceFromUniform(std::vector<double> p_values) {
  std::ranges::sort(p_values);
  double distance = 0.0;
  const auto n = static_cast<double>(p_values.size());
  for (std::size_t i = 0; i < p_values.size(); ++i) {
    distance = std::max({distance, std::abs(p_values[i] - static_cast<double>(i) / n),
                         std::abs(p_values[i] - static_cast<double>(i + 1) / n)});
  }
  return distance;
}

constexpr int kNumStudies = 2000;
// Kolmogorov's bound at 1e-6 for 2000 studies: sqrt(ln(2 / 1e-6) / 2 / 2000) = 0.060. The steps of
// the exact p-values (2 / 1024 and 2 / 252) come on top.
constexpr double kUniformBound = 0.060 + 0.008;

TEST(SignFlipPValue, IsUniformUnderTheHypothesis) {
  base::Random random(8);
  std::vector<double> p_values;
  std::vector<double> shifted;
  for (int k = 0; k < kNumStudies; ++k) {
    p_values.push_back(SignFlipPValue(Normals(random, 10, 0.0)));
    shifted.push_back(SignFlipPValue(Normals(random, 10, 0.5)));
  }
  EXPECT_LT(DistanceFromUniform(p_values), kUniformBound);
  EXPECT_GT(DistanceFromUniform(shifted), kUniformBound);
}

TEST(RelabellingPValue, IsUniformUnderTheHypothesis) {
  base::Random random(9);
  std::vector<double> p_values;
  for (int k = 0; k < kNumStudies; ++k) {
    p_values.push_back(RelabellingPValue(Normals(random, 5, 0.0), Normals(random, 5, 0.0)));
  }
  EXPECT_LT(DistanceFromUniform(p_values), kUniformBound);
}

TEST(RelabellingPValue, MatchesHandCountedCases) {
  // One of the C(4, 2) = 6 choices and its mirror are as far apart.
  EXPECT_DOUBLE_EQ(RelabellingPValue(std::vector{1.0, 2.0}, std::vector{3.0, 4.0}), 2.0 / 6.0);
  EXPECT_DOUBLE_EQ(RelabellingPValue(std::vector{1.0, 1.0}, std::vector{1.0}), 1.0);
  base::Random random(3);
  const auto first = Normals(random, 6, 0.8);
  const auto second = Normals(random, 7, 0.0);
  const double exact = RelabellingPValue(first, second);
  EXPECT_DOUBLE_EQ(RelabellingPValue(second, first), exact);
  const double drawn = RelabellingPValue(first, second, {.max_exact = 1, .num_samples = 50000});
  EXPECT_NEAR(drawn, exact, 5.0 * std::sqrt(exact * (1.0 - exact) / 50000.0) + 2e-5);
}

// The p-value of the policies holds for these policies. Where whole trainings differ, it finds
// differences between agents that are none, and the p-value of the trainings does not.
TEST(ComparePaired, OnlyRelabellingSeesTheNoiseOfTraining) {
  base::Random random(12);
  int num_policies = 0;
  int num_trainings = 0;
  constexpr int kStudies = 400;
  for (int k = 0; k < kStudies; ++k) {
    ScoreTable tables[2];
    for (ScoreTable& table : tables) {
      table.limits = {-10.0, 10.0};
      for (int s = 0; s < 4; ++s) {
        const double shift = 0.5 * random.Normal();
        table.scores.push_back(Normals(random, 20, shift));
      }
    }
    const PairedTest test = ComparePaired(tables[0], tables[1], {.num_samples = 100},
                                          {.max_exact = 1 << 10, .num_samples = 500});
    num_policies += test.p_value <= 0.05;
    num_trainings += test.training_p_value.value() <= 0.05;
  }
  // Four standard errors of a share of 0.05 in 400 studies: 4 sqrt(0.05 * 0.95 / 400) = 0.044.
  EXPECT_LE(num_trainings, (0.05 + 0.044) * kStudies);
  EXPECT_GT(num_policies, 0.3 * kStudies);
}

TEST(ComparePaired, TurnedRoundHasTheSamePValues) {
  const ScoreTable first{"a", {{0.1, 0.5, 0.9, 1.0}, {0.2, 0.6, 0.8, 1.0}}, {0.0, 1.0}};
  const ScoreTable second{"b", {{0.0, 0.5, 0.5, 0.9}, {0.1, 0.2, 0.8, 0.9}}, {0.0, 1.0}};
  const PairedTest there = ComparePaired(first, second);
  const PairedTest back = ComparePaired(second, first);
  EXPECT_NEAR(there.difference.value, -back.difference.value, 1e-12);
  EXPECT_EQ(there.p_value, back.p_value);
  EXPECT_EQ(there.training_p_value, back.training_p_value);
  EXPECT_EQ(there.num_pairs, 4);
  const ScoreTable single{"c", {{0.1, 0.5, 0.9, 1.0}}, {0.0, 1.0}};
  EXPECT_FALSE(ComparePaired(single, second).training_p_value);
}

/// `num_seeds` policies on 20 courses, all alike but for a little, with a mean of `mean`.
ScoreTable Alike(int num_seeds, double mean, bool trained = true) {
  ScoreTable table{"agent", {}, {0.0, 1.0}, trained};
  for (int s = 0; s < num_seeds; ++s) {
    table.scores.emplace_back(20, mean + 0.001 * s);
    for (std::size_t c = 0; c < 20; ++c) table.scores.back()[c] += 0.002 * static_cast<double>(c);
  }
  return table;
}

Verdict VerdictOn(const ScoreTable& first, const ScoreTable& second, int num_compared = 1) {
  const PairedTest test = ComparePaired(first, second);
  const auto times = [num_compared](double p) { return std::min(1.0, num_compared * p); };
  std::optional<double> training;
  if (test.training_p_value) training = times(*test.training_p_value);
  return VerdictOf(test, times(test.p_value), training,
                   training ? static_cast<std::size_t>(num_compared) : 0);
}

// All of these differ by 50 points on every course, so p of the policies is 2 / 2^20.
TEST(VerdictOf, SpeaksOfTrainingsAndNeedsEnoughOfThem) {
  const auto differing = [](int seeds, int num_compared = 1) {
    return VerdictOn(Alike(seeds, 0.2), Alike(seeds, 0.7), num_compared);
  };
  EXPECT_EQ(differing(1), Verdict::kTooFewSeeds);
  EXPECT_EQ(differing(2), Verdict::kTooFewSeeds);
  EXPECT_EQ(differing(3), Verdict::kTooFewSeeds);  // 2 of 20 choices.
  EXPECT_EQ(differing(4), Verdict::kDiffers);      // 2 of 70.
  EXPECT_EQ(differing(4, 2), Verdict::kTooFewSeeds);
  EXPECT_EQ(differing(5, 6), Verdict::kDiffers);  // 2 of 252.
  EXPECT_EQ(differing(5, 7), Verdict::kTooFewSeeds);
  EXPECT_EQ(VerdictOn(Alike(3, 0.2), Alike(4, 0.7)), Verdict::kDiffers);  // 1 of 35.
  EXPECT_EQ(VerdictOn(Alike(5, 0.5), Alike(5, 0.5)), Verdict::kCouldBeChance);
  EXPECT_EQ(VerdictOn(Alike(3, 0.5), Alike(3, 0.5)), Verdict::kTooFewSeeds);
}

TEST(VerdictOf, APlannerHasNoSeedsToBeLuckyWith) {
  const auto planner = [](double mean) { return Alike(1, mean, false); };
  EXPECT_EQ(VerdictOn(planner(0.2), planner(0.7)), Verdict::kDiffers);
  EXPECT_EQ(VerdictOn(planner(0.5), planner(0.5)), Verdict::kCouldBeChance);
  EXPECT_FALSE(ComparePaired(planner(0.2), planner(0.7)).training_p_value);
  // Signs of the seeds' differences: 2 of 2^5 are as extreme, 2 of 2^6.
  EXPECT_EQ(*ComparePaired(planner(0.2), Alike(5, 0.7)).training_p_value, 2.0 / 32.0);
  EXPECT_EQ(VerdictOn(planner(0.2), Alike(5, 0.7)), Verdict::kTooFewSeeds);
  EXPECT_EQ(VerdictOn(Alike(6, 0.7), planner(0.2)), Verdict::kDiffers);
  EXPECT_EQ(VerdictOn(planner(0.2), Alike(1, 0.7)), Verdict::kTooFewSeeds);
}

TEST(HolmCorrection, MatchesAHandComputedCase) {
  // Sorted 0.01, 0.02, 0.03, 0.04: times 4, 3, 2, 1, and none below the one before it.
  const auto corrected = HolmCorrection(std::vector{0.04, 0.01, 0.03, 0.02});
  EXPECT_NEAR(corrected[1], 0.04, 1e-12);
  EXPECT_NEAR(corrected[3], 0.06, 1e-12);
  EXPECT_NEAR(corrected[2], 0.06, 1e-12);
  EXPECT_NEAR(corrected[0], 0.06, 1e-12);
  EXPECT_EQ(HolmCorrection(std::vector{0.7, 0.9}), (std::vector{1.0, 1.0}));
  EXPECT_TRUE(HolmCorrection({}).empty());
}

}  // namespace
}  // namespace slalom::eval
