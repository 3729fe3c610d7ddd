#include "replay/table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tests/replay/model.h"

namespace slalom::replay {
namespace {

constexpr int kBeams = 5;

/// The whole of a sampled batch against the model.
void ExpectMatches(const ReplayModel& model, const SampleSpec& spec, const Batch& batch) {
  const env::StepShape shape = batch.rows.shape;
  const auto n = static_cast<std::size_t>(shape.num_beams);
  const auto size = static_cast<std::size_t>(shape.state_size);
  for (int b = 0; b < spec.batch; ++b) {
    const auto expected = model.Expect(batch.rows.sequence[b], spec);
    ASSERT_TRUE(expected) << "row " << batch.rows.sequence[b] << " may not be drawn";
    for (int i = 0; i < shape.action_size; ++i) {
      EXPECT_EQ(batch.rows.action[b * shape.action_size + i], expected->history.back()->action[i]);
    }
    EXPECT_EQ(batch.rows.n_step_return[b], static_cast<float>(expected->n_step_return));
    EXPECT_EQ(batch.rows.cost_return[b], static_cast<float>(expected->cost_return));
    EXPECT_EQ(batch.rows.discount[b], static_cast<float>(expected->discount));
    for (int h = 0; h < spec.history; ++h) {
      const std::size_t frame = static_cast<std::size_t>(b) * spec.history + h;
      const auto& now = *expected->history[h];
      const auto& next = *expected->next_history[h];
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(batch.ranges_cm[frame * n + i], now.ranges_cm[i]);
        ASSERT_EQ(batch.next_ranges_cm[frame * n + i], next.ranges_cm[i]);
      }
      for (std::size_t i = 0; i < size; ++i) {
        ASSERT_EQ(batch.rows.state[frame * size + i], now.state[i]);
        ASSERT_EQ(batch.rows.next_state[frame * size + i], next.state[i]);
      }
    }
  }
}

struct Case {
  std::int64_t capacity;
  int num_streams;
  int history;
  int n_step;
  env::StepShape shape = kBeams;
};

class TableProperty : public testing::TestWithParam<Case> {};

TEST_P(TableProperty, AgreesWithListsOfEpisodes) {
  const Case c = GetParam();
  ReplayModel model(c.capacity, c.shape, c.num_streams,
                    base::DeriveSeed(7, "table",
                                     {static_cast<std::uint64_t>(c.history),
                                      static_cast<std::uint64_t>(c.n_step)}));
  Table table({.capacity = c.capacity}, c.shape);
  base::Random random(11);
  const SampleSpec spec{.batch = 70, .history = c.history, .n_step = c.n_step, .gamma = 0.9};
  Batch batch;
  const int steps = static_cast<int>(12 * c.capacity / c.num_streams);
  for (int i = 0; i < steps; ++i) {
    model.Advance(&table);
    ASSERT_EQ(table.total_inserted(), model.total());
    if (i % 7 != 0) continue;
    const auto eligible = model.Eligible(spec);
    ASSERT_EQ(table.CountEligible(c.history, c.n_step), static_cast<std::int64_t>(eligible.size()));
    ASSERT_EQ(table.num_steps(), model.num_steps());
    ASSERT_EQ(table.Sample(spec, random, &batch), !eligible.empty());
    if (!eligible.empty()) ExpectMatches(model, spec, batch);
    if (testing::Test::HasFailure()) FAIL() << "after " << i << " batch steps";
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, TableProperty,
                         testing::Values(Case{50, 1, 1, 1}, Case{60, 1, 1, 4}, Case{60, 3, 4, 1},
                                         Case{100, 4, 8, 8}, Case{300, 7, 4, 4},
                                         Case{301, 16, 8, 5}, Case{20, 5, 2, 3}, Case{400, 2, 3, 8},
                                         Case{100, 4, 4, 3, {0, 3, 1}},
                                         Case{100, 4, 4, 3, {2, 17, 6}}));

/// Chi-square statistic of draws over `eligible` by a sampler of sequence numbers.
template <class Draw>
double ChiSquare(const std::vector<std::int64_t>& eligible, int draws_per_cell, Draw draw_batch) {
  std::map<std::int64_t, int> counts;
  for (const std::int64_t s : eligible) counts[s] = 0;
  const int draws = draws_per_cell * static_cast<int>(eligible.size());
  int drawn = 0;
  while (drawn < draws) {
    for (const std::int64_t s : draw_batch()) {
      if (drawn == draws) break;
      ++counts.at(s);
      ++drawn;
    }
  }
  double chi_square = 0.0;
  for (const auto& [s, count] : counts) {
    chi_square += std::pow(count - draws_per_cell, 2) / draws_per_cell;
  }
  return chi_square;
}

TEST(TableTest, DrawsAreUniformOverTheEligible) {
  ReplayModel model(300, kBeams, 6, 5);
  Table table({.capacity = 300}, kBeams);
  for (int i = 0; i < 200; ++i) model.Advance(&table);
  const SampleSpec spec{.batch = 64, .history = 4, .n_step = 4, .gamma = 0.9};
  const auto eligible = model.Eligible(spec);
  const double cells = static_cast<double>(eligible.size());
  ASSERT_GT(cells, 100.0);
  // Chi-square with f degrees of freedom has mean f and variance 2 f; at f > 100 it is nearly
  // normal, and 5 standard deviations are exceeded with probability < 1e-5.
  const double freedom = cells - 1.0;
  const double bound = freedom + 5.0 * std::sqrt(2.0 * freedom);

  base::Random random(3);
  SampledRows rows;
  EXPECT_LT(ChiSquare(eligible, 200,
                      [&] {
                        EXPECT_TRUE(table.SampleRows(spec, random, &rows));
                        return rows.sequence;
                      }),
            bound);
  // The same check refuses a sampler that moves on from what may not be drawn instead of drawing
  // again, and so favours the rows behind such gaps.
  const std::set<std::int64_t> set(eligible.begin(), eligible.end());
  EXPECT_GT(ChiSquare(eligible, 200,
                      [&] {
                        const auto draw = model.oldest() + static_cast<std::int64_t>(
                                                               random.UniformInt(table.num_rows()));
                        const auto it = set.lower_bound(draw);
                        return std::vector{it == set.end() ? *set.begin() : *it};
                      }),
            bound);
}

TEST(TableTest, FindsTheOneEligibleStepAmongMany) {
  Table table({.capacity = 20000}, 1);
  Chunk chunk(1);
  const std::vector<std::uint16_t> scan{1};
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  chunk.AddStep(0, true, frame, {}, {.reward = 2.5f, .outcome = env::Outcome::kSuccess});
  chunk.AddFinal(0, frame);
  for (int s = 1; s < 10000; ++s) chunk.AddStep(s, true, frame, {}, {});
  table.Insert(chunk);
  base::Random random(1);
  SampledRows rows;
  ASSERT_TRUE(table.SampleRows({.batch = 130, .n_step = 4}, random, &rows));
  for (int b = 0; b < 130; ++b) {
    EXPECT_EQ(rows.sequence[b], 0);
    EXPECT_EQ(rows.n_step_return[b], 2.5f);
    EXPECT_EQ(rows.discount[b], 0.0f);
  }
}

TEST(TableTest, PrioritiesHoldWhereFewStepsAreEligible) {
  Table table({.capacity = 20000}, 1);
  Chunk chunk(1);
  const std::vector<std::uint16_t> scan{1};
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  for (int s = 0; s < 10000; ++s) {
    const bool whole = s < 2;
    chunk.AddStep(s, true, frame, {},
                  {.outcome = whole ? env::Outcome::kSuccess : env::Outcome::kRunning});
    if (whole) chunk.AddFinal(s, frame);
  }
  table.Insert(chunk);
  table.UsePriorities(1.0);
  const std::vector<std::int64_t> steps{0, 2};  // Rows 1 and 3 are final.
  ASSERT_EQ(table.SetPriorities(steps, std::vector{1.0f, 9.0f}), 2);
  base::Random random(1);
  SampledRows rows;
  ASSERT_TRUE(table.SampleRows({.batch = 2000, .n_step = 4, .prioritized = true}, random, &rows));
  const auto second = std::ranges::count(rows.sequence, 2);
  EXPECT_EQ(std::ranges::count(rows.sequence, 0) + second, 2000);
  // Mean 2000 * 0.9, deviation sqrt(2000 * 0.9 * 0.1) = 13.4; four.
  EXPECT_NEAR(static_cast<double>(second), 1800.0, 54.0);
}

// A stream that pauses for exactly capacity - 1 rows overwrites its own last row.
TEST(TableTest, ARowIsNotLinkedToTheOneThatItOverwrites) {
  Table table({.capacity = 4}, 1);
  Chunk chunk(1);
  const std::vector<std::uint16_t> scan{1};
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  chunk.AddStep(0, true, frame, {}, {});
  for (int k = 0; k < 3; ++k) chunk.AddStep(1, k == 0, frame, {}, {});
  chunk.AddStep(0, false, frame, {}, {});
  table.Insert(chunk);
  EXPECT_EQ(table.CountEligible(1, 1), 2) << "rows 1 and 2; 3 and 4 are followed by nothing";
}

TEST(TableTest, NothingToDrawIsAnAnswer) {
  Table table({.capacity = 100}, 1);
  base::Random random(1);
  SampledRows rows;
  EXPECT_FALSE(table.SampleRows({.batch = 3}, random, &rows));
  const std::vector<std::uint16_t> scan{1};
  const std::vector<float> state(env::kStateSize, 0.0f);
  Chunk chunk(1);
  chunk.AddStep(0, true, {scan, state}, {}, {});
  table.Insert(chunk);
  EXPECT_FALSE(table.SampleRows({.batch = 3}, random, &rows));
}

TEST(TableTest, AMillionStepsTakeLessThan1600Megabytes) {
  Table table({.capacity = 1000}, 720);
  Chunk chunk(720);
  const std::vector<std::uint16_t> scan(720, 100);
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  // Episodes of 20 steps, as short as they are early in training.
  while (table.num_rows() < 1000) {
    chunk.Clear();
    for (int i = 0; i < 20; ++i) chunk.AddStep(0, i == 0, frame, {}, {});
    chunk.AddFinal(0, frame);
    table.Insert(chunk);
  }
  const double bytes_per_step = static_cast<double>(table.bytes()) / table.num_steps();
  EXPECT_LT(bytes_per_step, 1600.0);
  EXPECT_GT(bytes_per_step, 2.0 * 720);
}

TEST(TableDeathTest, AnEpisodeMustBeginWithItsFirstStep) {
  Table table({.capacity = 100}, 1);
  const std::vector<std::uint16_t> scan{1};
  const std::vector<float> state(env::kStateSize, 0.0f);
  Chunk chunk(1);
  chunk.AddStep(0, false, {scan, state}, {}, {});
  EXPECT_DEATH(table.Insert(chunk), "is_first");
}

}  // namespace
}  // namespace slalom::replay
