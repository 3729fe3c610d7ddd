#include "base/parallel.h"

#include <gmock/gmock.h>

#include <atomic>
#include <cerrno>
#include <stdexcept>
#include <thread>
#include <vector>

#include "base/error.h"
#include "tests/support/failing_calls.h"

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

// The body of index 0 ends only after all others have: their thread's neighbours must have taken
// them over.
TEST_P(ParallelForTest, WhatALateThreadHasNotBegunIsDoneByOthers) {
  if (GetParam() == 1) return;
  ParallelFor parallel(GetParam());
  for (int round = 0; round < 20; ++round) {
    constexpr int kCount = 40;
    std::atomic<int> done = 0;
    parallel.For(kCount, [&](int i) {
      while (i == 0 && done < kCount - 1) std::this_thread::yield();
      ++done;
    });
    EXPECT_EQ(done, kCount);
  }
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

// Those that were started before end.
TEST(ParallelForErrorTest, AThreadThatCannotBeStartedIsAnError) {
  const test::FailingCalls failing(
      {.function = "pthread_create", .path = "thread", .error = EAGAIN, .first = 3}, "none");
  EXPECT_THAT([] { ParallelFor parallel(8); },
              testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr("number 4 of 8"),
                                                           testing::HasSubstr("ulimit -u"))));
  EXPECT_EQ(failing.num_calls(), 3);
}

INSTANTIATE_TEST_SUITE_P(Threads, ParallelForTest, testing::Values(1, 2, 3, 8));

}  // namespace
}  // namespace slalom::base
