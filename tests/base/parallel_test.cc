#include "base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace slalom::base {
namespace {

class ParallelForTest : public testing::TestWithParam<int> {};

TEST_P(ParallelForTest, CallsTheBodyOnceForEachIndex) {
  ParallelFor parallel(GetParam());
  EXPECT_EQ(parallel.num_threads(), GetParam());
  for (const int n : {0, 1, 2, 3, 7, 64, 1000}) {
    std::vector<std::atomic<int>> calls(n);
    parallel.For(n, [&](int i) { ++calls.at(i); });
    for (const auto& count : calls) ASSERT_EQ(count, 1);
  }
}

TEST_P(ParallelForTest, WhatABodyWroteIsSeenAfterwards) {
  ParallelFor parallel(GetParam());
  std::vector<int> values(257, 0);
  for (int round = 1; round <= 200; ++round) {
    parallel.For(static_cast<int>(values.size()), [&](int i) { values[i] += i; });
  }
  for (int i = 0; i < static_cast<int>(values.size()); ++i) EXPECT_EQ(values[i], 200 * i);
}

TEST_P(ParallelForTest, AnExceptionComesBackAndTheNextLoopRuns) {
  ParallelFor parallel(GetParam());
  for (int bad = 0; bad < 8; ++bad) {
    EXPECT_THROW(parallel.For(8,
                              [&](int i) {
                                if (i == bad) throw std::runtime_error("planned");
                              }),
                 std::runtime_error);
  }
  std::atomic<int> calls = 0;
  parallel.For(8, [&](int) { ++calls; });
  EXPECT_EQ(calls, 8);
}

INSTANTIATE_TEST_SUITE_P(Threads, ParallelForTest, testing::Values(1, 2, 3, 8));

}  // namespace
}  // namespace slalom::base
