#include "learner/run/training_clock.h"

#include <gtest/gtest.h>

namespace slalom::run {
namespace {

class TrainingClockTest : public testing::Test {
 protected:
  /// The process works for so long, on one processor.
  void Work(double seconds) {
    now_.wall_s += seconds;
    now_.processor_s += seconds;
  }
  /// Time passes in which the process uses no processor: it waits, or does not run.
  void Wait(double seconds) { now_.wall_s += seconds; }

  ClockReading now_{.wall_s = 1e6, .processor_s = 3.0};
  TrainingClock clock_{[this] { return now_; }};
};

TEST_F(TrainingClockTest, CountsBetweenStartAndStopOnly) {
  Work(400.0);
  clock_.Look();
  EXPECT_EQ(clock_.training_s(), 0.0);
  clock_.Start();
  Work(0.5);
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.training_s(), 0.5);
  Work(0.25);
  clock_.Stop();
  Work(400.0);
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.training_s(), 0.75);
  clock_.Start();
  Work(0.0625);
  clock_.Start();
  Work(0.0625);
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.training_s(), 0.875);
}

TEST_F(TrainingClockTest, GoesOnFromWhatEarlierSessionsTrained) {
  clock_.Restore(90.0);
  Work(20.0);
  clock_.Start();
  Work(0.5);
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.training_s(), 90.5);
}

TEST_F(TrainingClockTest, WaitsThatAreShortCountInFull) {
  clock_.Start();
  for (int i = 0; i < 100; ++i) {
    Wait(0.99);
    clock_.Look();
  }
  EXPECT_NEAR(clock_.training_s(), 99.0, 1e-6);
}

// Ctrl-Z over a night: the process used no processor.
TEST_F(TrainingClockTest, TimeInWhichTheProcessDidNotRunDoesNotCount) {
  clock_.Start();
  Work(0.5);
  Wait(30000.0);
  Work(0.25);
  clock_.Look();
  EXPECT_NEAR(clock_.training_s(), TrainingClock::kLongestGap, 1e-6);
}

// A turn of the loop that writes a large checkpoint: work counts, whatever was waited for does not.
TEST_F(TrainingClockTest, WorkInALongGapCounts) {
  clock_.Start();
  Work(4.0);
  Wait(10.0);
  clock_.Look();
  EXPECT_NEAR(clock_.training_s(), 4.0, 1e-6);
}

TEST_F(TrainingClockTest, SeveralThreadsDoNotCountAsMoreTime) {
  clock_.Start();
  now_.wall_s += 5.0;
  now_.processor_s += 40.0;
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.training_s(), 5.0);
}

TEST_F(TrainingClockTest, TheWallClockGoesOnWhileTheTrainingClockStands) {
  const double before = clock_.wall_s();
  Wait(30.0);
  clock_.Look();
  EXPECT_DOUBLE_EQ(clock_.wall_s() - before, 30.0);
  EXPECT_EQ(clock_.training_s(), 0.0);
}

TEST(ReadProcessClocksTest, WorkMovesBothClocks) {
  const ClockReading before = ReadProcessClocks();
  ClockReading now = before;
  while (now.processor_s - before.processor_s < 0.01) now = ReadProcessClocks();
  EXPECT_GT(now.wall_s, before.wall_s);
}

}  // namespace
}  // namespace slalom::run
