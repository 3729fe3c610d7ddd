#include "base/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

namespace slalom::base {
namespace {

// xoshiro256++ from the state {1, 2, 3, 4}, worked out by hand from the published algorithm for the
// first result: rotl(1 + 4, 23) + 1.
TEST(RandomTest, FirstResultIsThatOfTheAlgorithm) {
  Random random(0);
  random.set_state({1, 2, 3, 4});
  EXPECT_EQ(random.NextU64(), (5ull << 23) + 1);
}

// The numbers that every recorded seed stands for must never change.
TEST(RandomTest, StreamIsFixed) {
  Random random(42);
  EXPECT_EQ(random.NextU64(), 15021278609987233951ull);
  EXPECT_EQ(random.NextU64(), 5881210131331364753ull);
}

TEST(RandomTest, AStateThatIsSetContinuesTheStream) {
  Random a(7);
  for (int i = 0; i < 10; ++i) a.NextU64();
  Random b(8);
  b.set_state(a.state());
  for (int i = 0; i < 10; ++i) EXPECT_EQ(a.NextU64(), b.NextU64());
}

TEST(RandomTest, SeedsOfDifferentPurposesAndIndicesDiffer) {
  std::set<std::uint64_t> seeds;
  int count = 0;
  for (const std::uint64_t root : {0, 1, 2}) {
    for (const char* purpose : {"", "a", "b", "ab", "actor", "evaluation"}) {
      seeds.insert(DeriveSeed(root, purpose));
      ++count;
      for (std::uint64_t i = 0; i < 20; ++i) {
        seeds.insert(DeriveSeed(root, purpose, {i}));
        seeds.insert(DeriveSeed(root, purpose, {i, 0}));
        seeds.insert(DeriveSeed(root, purpose, {0, 0, i}));
        count += 3;
      }
    }
  }
  EXPECT_EQ(static_cast<int>(seeds.size()), count);
}

double ChiSquare(const std::vector<int>& counts, double expected) {
  double sum = 0.0;
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

// With f degrees of freedom chi-square has mean f and variance 2 f. At f = 99, the mean plus 5
// standard deviations (its tail is a little heavier than the normal's) is exceeded with probability
// < 1e-4; the seed is fixed.
constexpr int kCells = 100;
constexpr int kDrawsPerCell = 2000;
const double kChiSquareBound = 99.0 + 5.0 * std::sqrt(2.0 * 99.0);

template <class Draw>
double ChiSquareOf(Draw draw) {
  std::vector<int> counts(kCells, 0);
  for (int i = 0; i < kCells * kDrawsPerCell; ++i) ++counts.at(draw());
  return ChiSquare(counts, kDrawsPerCell);
}

TEST(RandomTest, UniformIntIsUniform) {
  Random random(1);
  EXPECT_LT(ChiSquareOf([&] { return random.UniformInt(kCells); }), kChiSquareBound);
}

TEST(RandomTest, UniformIsUniform) {
  Random random(2);
  EXPECT_LT(ChiSquareOf([&] { return static_cast<std::size_t>(random.Uniform() * kCells); }),
            kChiSquareBound);
}

TEST(RandomTest, NormalFallsEquallyBetweenItsQuantiles) {
  Random random(3);
  EXPECT_LT(ChiSquareOf([&] {
              const double p = 0.5 * std::erfc(-random.Normal() / std::sqrt(2.0));
              return std::min<std::size_t>(kCells - 1, static_cast<std::size_t>(p * kCells));
            }),
            kChiSquareBound);
}

TEST(RandomTest, TheBoundRefusesASlightlyWrongSampler) {
  Random random(4);
  // One draw in fifty lands in the lower half only.
  EXPECT_GT(
      ChiSquareOf([&] { return random.UniformInt(random.Uniform() < 0.1 ? kCells / 2 : kCells); }),
      kChiSquareBound);
}

TEST(RandomTest, NormalHasTheMomentsOfANormal) {
  Random random(5);
  constexpr int kDraws = 1000000;
  double sum = 0.0;
  double squares = 0.0;
  double fourths = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Normal();
    sum += x;
    squares += x * x;
    fourths += x * x * x * x;
  }
  // Standard errors: 1, sqrt(2) and sqrt(96) over sqrt(draws); five of each.
  EXPECT_NEAR(sum / kDraws, 0.0, 5.0 / std::sqrt(kDraws));
  EXPECT_NEAR(squares / kDraws, 1.0, 5.0 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(fourths / kDraws, 3.0, 5.0 * std::sqrt(96.0 / kDraws));
}

TEST(RandomTest, UniformStaysInItsInterval) {
  Random random(6);
  for (int i = 0; i < 100000; ++i) {
    const double x = random.Uniform(-3.0, 5.0);
    ASSERT_GE(x, -3.0);
    ASSERT_LT(x, 5.0);
  }
}

TEST(RandomTest, NormalQuantileAgreesWithKnownValues) {
  // From tables to 16 digits.
  EXPECT_DOUBLE_EQ(NormalQuantile(0.5), 0.0);
  EXPECT_NEAR(NormalQuantile(0.975), 1.959963984540054, 4e-15);
  EXPECT_NEAR(NormalQuantile(0.995), 2.575829303548901, 4e-15);
  EXPECT_NEAR(NormalQuantile(0.999), 3.090232306167813, 4e-15);
  EXPECT_NEAR(NormalQuantile(1e-6), -4.753424308822899, 8e-15);
  EXPECT_NEAR(NormalQuantile(1e-20), -9.262340089798408, 2e-14);
}

TEST(RandomTest, NormalQuantileUndoesTheDistributionFunction) {
  for (double x = -8.0; x <= 5.0; x += 0.01) {
    const double p = 0.5 * std::erfc(-x / std::sqrt(2.0));
    // p has a relative error of about 4e-16, which the slope 1 / density carries over to x.
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2.0 * 3.14159265358979);
    ASSERT_NEAR(NormalQuantile(p), x, 1e-14 * std::abs(x) + 1e-15 * p / density + 1e-15) << x;
  }
}

}  // namespace
}  // namespace slalom::base
