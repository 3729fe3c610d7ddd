#include "replay/priorities.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "replay/table.h"
#include "tests/replay/model.h"

namespace slalom::replay {
namespace {

using Sampler = std::function<std::int64_t()>;

/// Pearson's statistic of `n` draws against probabilities in proportion to `weights`.
double ChiSquare(const std::vector<double>& weights, const Sampler& draw, int n) {
  std::vector<double> counts(weights.size());
  for (int i = 0; i < n; ++i) ++counts[static_cast<std::size_t>(draw())];
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  double statistic = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0.0) {
      EXPECT_EQ(counts[i], 0.0) << "slot " << i << " has no weight and was drawn";
      continue;
    }
    const double expected = n * weights[i] / total;
    // Pearson's approximation wants some 5 expected draws in every cell.
    EXPECT_GE(expected, 5.0) << "the test needs more draws";
    statistic += (counts[i] - expected) * (counts[i] - expected) / expected;
  }
  return statistic;
}

/// What `ChiSquare` exceeds once in a million times (Wilson and Hilferty's approximation).
double Bound(const std::vector<double>& weights) {
  double cells = 0.0;
  for (const double w : weights) cells += w > 0.0;
  const double k = cells - 1.0;
  const double z = base::NormalQuantile(1.0 - 1e-6);
  const double root = 1.0 - 2.0 / (9.0 * k) + z * std::sqrt(2.0 / (9.0 * k));
  return k * root * root * root;
}

struct Filled {
  Priorities priorities;
  std::vector<double> weights;
};

Filled Fill(std::int64_t slots, double alpha, base::Random& random) {
  Filled filled{Priorities(slots, alpha), std::vector<double>(slots)};
  for (std::int64_t i = 0; i < slots; ++i) {
    const double p = std::exp(random.Uniform(-2.0, 2.0));
    filled.priorities.Set(i, p);
    filled.weights[i] = std::pow(p, alpha);
    if (i > 1 && random.Uniform() < 0.2) {
      filled.priorities.Clear(i);
      filled.weights[i] = 0.0;
    }
  }
  return filled;
}

class PrioritiesShape : public testing::TestWithParam<std::pair<std::int64_t, double>> {};

TEST_P(PrioritiesShape, DrawsInProportionToTheWeights) {
  const std::int64_t slots = GetParam().first;  // clang++ 14 captures no structured binding.
  const double alpha = GetParam().second;
  base::Random random(base::DeriveSeed(3, "priorities", {static_cast<std::uint64_t>(slots)}));
  Filled filled = Fill(slots, alpha, random);
  const int n = static_cast<int>(300 * slots) + 20000;
  std::vector<std::int64_t> draws;
  const Sampler tree = [&] {
    if (draws.empty()) {
      draws.resize(100);
      filled.priorities.Draw(random, draws);
    }
    const std::int64_t draw = draws.back();
    draws.pop_back();
    return draw;
  };
  EXPECT_LT(ChiSquare(filled.weights, tree, n), Bound(filled.weights));
  EXPECT_NEAR(filled.priorities.total(),
              std::accumulate(filled.weights.begin(), filled.weights.end(), 0.0),
              1e-12 * slots * 10);

  // The bound sees a sampler that is wrong: it draws one slot too high every twentieth time.
  if (slots < 9) return;
  int turn = 0;
  const Sampler wrong = [&] {
    std::int64_t draw = tree();
    if (++turn % 20 != 0) return draw;
    do draw = (draw + 1) % slots;
    while (filled.weights[draw] == 0.0);
    return draw;
  };
  EXPECT_GT(ChiSquare(filled.weights, wrong, n), Bound(filled.weights));
}

INSTANTIATE_TEST_SUITE_P(Shapes, PrioritiesShape,
                         testing::Values(std::pair{3, 1.0}, std::pair{8, 0.6}, std::pair{9, 1.0},
                                         std::pair{64, 0.6}, std::pair{65, 0.9},
                                         std::pair{700, 0.4}));

TEST(PrioritiesTest, ALoneSlotIsAlwaysDrawnWhereverItLies) {
  base::Random random(5);
  for (std::int64_t slot = 0; slot < 513; ++slot) {
    Priorities priorities(513, 0.6);
    EXPECT_EQ(priorities.total(), 0.0);
    priorities.Set(slot, 1e-6);
    std::vector<std::int64_t> draws(70, -1);
    priorities.Draw(random, draws);
    EXPECT_EQ(draws, std::vector<std::int64_t>(70, slot));
  }
}

TEST(PrioritiesTest, PrioritiesAreHeldToTheirBoundsAndNewRowsGetTheLargest) {
  Priorities priorities(4, 0.5);
  priorities.SetNew(0);
  EXPECT_EQ(priorities.weight(0), 1.0);
  priorities.Set(1, 16.0);
  EXPECT_EQ(priorities.weight(1), 4.0);
  priorities.Set(1, 0.25);
  EXPECT_EQ(priorities.weight(1), 0.5);
  priorities.SetNew(2);
  EXPECT_EQ(priorities.weight(2), 4.0);
  priorities.Set(3, 0.0);
  EXPECT_EQ(priorities.weight(3), std::sqrt(Priorities::kSmallest));
  priorities.Set(3, std::numeric_limits<double>::infinity());
  EXPECT_EQ(priorities.weight(3), std::sqrt(Priorities::kLargest));
  priorities.Set(3, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(priorities.weight(3), std::sqrt(Priorities::kLargest));
}

// Eligible steps in proportion to their weights, whatever else the ring holds: open episodes, cut
// ones, final rows, steps whose history is overwritten. In a small ring most draws are rejected and
// the list of eligible steps is drawn from, too.
class PrioritizedTable : public testing::TestWithParam<int> {};

TEST_P(PrioritizedTable, DrawsEligibleStepsInProportion) {
  const int n_step = GetParam();
  constexpr int kBeams = 2;
  constexpr std::int64_t kCapacity = 120;
  constexpr double kAlpha = 0.7;
  const SampleSpec spec{.batch = 90,
                        .history = 2,
                        .n_step = n_step,
                        .gamma = 0.9,
                        .prioritized = true,
                        .importance_exponent = 0.4};
  ReplayModel model(kCapacity, kBeams, 3, 17);
  Table table({.capacity = kCapacity}, kBeams);
  for (int i = 0; i < 60; ++i) model.Advance(&table);
  table.UsePriorities(kAlpha);
  for (int i = 0; i < 3; ++i) model.Advance(&table);

  // All of the priorities ever set stay at most 1, so a row that was not set has 1.
  base::Random random(23);
  std::map<std::int64_t, double> priority;
  const auto set_some = [&] {
    std::vector<std::int64_t> rows;
    std::vector<float> values;
    for (std::int64_t s = model.oldest() - 5; s < model.total() + 5; ++s) {
      if (random.Uniform() < 0.6) continue;
      rows.push_back(s);
      values.push_back(static_cast<float>(random.Uniform(0.1, 1.0)));
      priority[s] = values.back();
    }
    EXPECT_LT(table.SetPriorities(rows, values), static_cast<std::int64_t>(rows.size()));
    std::erase_if(priority, [&](const auto& p) {
      return p.first < model.oldest() || p.first >= model.total();
    });
  };
  set_some();
  for (int i = 0; i < 7; ++i) model.Advance(&table);  // Overwrites rows that had a priority.
  set_some();

  const auto eligible = model.Eligible(spec);
  ASSERT_GE(eligible.size(), 5u);
  std::map<std::int64_t, std::size_t> place;
  std::vector<double> weights;
  for (const std::int64_t s : eligible) {
    place[s] = weights.size();
    weights.push_back(std::pow(priority.contains(s) ? priority[s] : 1.0, kAlpha));
  }
  SampledRows rows;
  std::vector<std::int64_t> draws;
  const Sampler draw = [&] {
    if (draws.empty()) {
      EXPECT_TRUE(table.SampleRows(spec, random, &rows));
      draws = rows.sequence;
      double smallest = 1e9;
      for (const std::int64_t s : draws) smallest = std::min(smallest, weights.at(place.at(s)));
      for (int b = 0; b < spec.batch; ++b) {
        const double expected = std::pow(smallest / weights[place[draws[b]]], 0.4);
        EXPECT_NEAR(rows.weight[b], expected, 1e-6);  // float against double
      }
    }
    const std::int64_t s = draws.back();
    draws.pop_back();
    return static_cast<std::int64_t>(place.at(s));
  };
  EXPECT_LT(ChiSquare(weights, draw, 40000), Bound(weights));
  const auto uniform = [&] { return static_cast<std::int64_t>(random.UniformInt(weights.size())); };
  EXPECT_GT(ChiSquare(weights, uniform, 40000), Bound(weights));
}

// With 11 steps a window is rarely whole here.
INSTANTIATE_TEST_SUITE_P(Steps, PrioritizedTable, testing::Values(1, 4, 11));

TEST(PrioritizedTableTest, WhatIsDrawnUniformlyDoesNotChangeWithPriorities) {
  ReplayModel model(100, 2, 3, 5);
  ReplayModel same(100, 2, 3, 5);
  Table plain({.capacity = 100}, 2);
  Table prioritized({.capacity = 100}, 2);
  prioritized.UsePriorities(0.6);
  for (int i = 0; i < 80; ++i) {
    model.Advance(&plain);
    same.Advance(&prioritized);
  }
  const SampleSpec spec{.batch = 64, .history = 1, .n_step = 3};
  base::Random a(1), b(1);
  SampledRows left, right;
  ASSERT_TRUE(plain.SampleRows(spec, a, &left));
  ASSERT_TRUE(prioritized.SampleRows(spec, b, &right));
  EXPECT_EQ(left.sequence, right.sequence);
  for (int i = 0; i < spec.batch; ++i) EXPECT_EQ(right.weight[i], 1.0f);
}

/// Two tables with the same rows, one of them with priorities.
struct BeforeAndAfter {
  explicit BeforeAndAfter(double alpha = 0.6) : alpha(alpha) {
    ReplayModel model(kCapacity, 2, 3, 5), again(kCapacity, 2, 3, 5);
    for (int i = 0; i < 80; ++i) {
      model.Advance(&before);
      again.Advance(&after);
    }
    before.UsePriorities(alpha);
    base::Random random(9);
    std::vector<std::int64_t> rows;
    std::vector<float> values;
    for (std::int64_t s = before.first_sequence(); s < before.total_inserted(); s += 2) {
      rows.push_back(s);
      values.push_back(static_cast<float>(random.Uniform(0.0, 5.0)));
    }
    before.SetPriorities(rows, values);
  }

  static std::vector<std::int64_t> Draw(const Table& table) {
    base::Random random(1);
    SampledRows rows;
    EXPECT_TRUE(table.SampleRows({.batch = 200, .history = 1, .n_step = 3, .prioritized = true},
                                 random, &rows));
    return rows.sequence;
  }

  static constexpr std::int64_t kCapacity = 100;
  const double alpha;
  Table before{{.capacity = kCapacity}, 2};
  Table after{{.capacity = kCapacity}, 2};
};

TEST(PrioritiesFileTest, WhatIsDrawnAfterARestartIsWhatWouldHaveBeen) {
  BeforeAndAfter tables;
  const auto failure = tables.after.RestorePriorities(tables.before.PrintPriorities(), 0.6);
  ASSERT_FALSE(failure) << failure->text;
  EXPECT_EQ(BeforeAndAfter::Draw(tables.after), BeforeAndAfter::Draw(tables.before));
  // So is what new rows begin with.
  ReplayModel left(50, 2, 1, 6), right(50, 2, 1, 6);
  for (Table* table : {&tables.before, &tables.after}) {
    for (int s = 0; s < table->num_streams(); ++s) table->Cut(s);
  }
  for (int i = 0; i < 20; ++i) {
    left.Advance(&tables.before);
    right.Advance(&tables.after);
  }
  EXPECT_EQ(BeforeAndAfter::Draw(tables.after), BeforeAndAfter::Draw(tables.before));
}

TEST(PrioritiesFileTest, RowsThatTheFileDoesNotKnowBeginWithTheLargest) {
  BeforeAndAfter tables;
  const std::string bytes = tables.before.PrintPriorities();
  ReplayModel more(50, 2, 1, 6);
  for (int s = 0; s < tables.after.num_streams(); ++s) tables.after.Cut(s);
  for (int i = 0; i < 400; ++i) more.Advance(&tables.after);  // None of the file's is held now.
  ASSERT_FALSE(tables.after.RestorePriorities(bytes, 0.6));
  const std::string restored = tables.after.PrintPriorities();
  std::set<double> weights;
  for (std::size_t at = 48; at + 8 < restored.size(); at += 8) {
    double weight = 0.0;
    std::memcpy(&weight, restored.data() + at, sizeof weight);
    weights.insert(weight);
  }
  weights.erase(0.0);  // Of final rows.
  ASSERT_EQ(weights.size(), 1u);
  EXPECT_GT(*weights.begin(), 1.0);
}

TEST(PrioritiesFileTest, DamageAndAnotherExponentAreToldAndChangeNothing) {
  BeforeAndAfter tables;
  const std::string bytes = tables.before.PrintPriorities();
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    ASSERT_TRUE(tables.after.RestorePriorities(damaged, 0.6)) << "byte " << i;
    ASSERT_TRUE(tables.after.RestorePriorities(bytes.substr(0, i), 0.6)) << "cut at " << i;
  }
  const auto failure = tables.after.RestorePriorities(bytes, 0.5);
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->text, "it was made with priority exponent 0.6, expected 0.5");
  EXPECT_FALSE(tables.after.has_priorities());
  EXPECT_FALSE(tables.after.RestorePriorities(bytes, 0.6));
}

}  // namespace
}  // namespace slalom::replay
