#include "replay/service/flow_control.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <map>

#include "base/random.h"

namespace slalom::replay {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr FlowControl::Options kOptions{
    .window_bytes = 4000, .room_bytes = 1000, .chunk_bytes = 400};
constexpr FlowControl::Time kStart{std::chrono::hours(1)};

/// A session that has all the room, and two that wait.
class FlowControlTest : public ::testing::Test {
 protected:
  FlowControlTest() {
    for (const std::uint32_t id : {1, 2, 3}) flow_.Attach(id);
    EXPECT_THAT(flow_.Grant(kStart, 4), ElementsAre(1));
    EXPECT_EQ(flow_.window(1), 1000);
    EXPECT_EQ(flow_.window(2), 0);
  }

  FlowControl flow_{kOptions};
};

TEST_F(FlowControlTest, CreditIsTakenBackOnceItWasUnusedForAMoment) {
  EXPECT_THAT(flow_.Grant(kStart + milliseconds(99), 4), IsEmpty());
  EXPECT_EQ(flow_.window(1), 1000);
  flow_.Grant(kStart + milliseconds(130), 4);
  EXPECT_EQ(flow_.window(1), 0);
  flow_.Grant(kStart + milliseconds(131), 4);
  EXPECT_EQ(flow_.window(2), 1000);
}

TEST_F(FlowControlTest, WhoeverUsesItsCreditKeepsIt) {
  flow_.Take(1, 100, kStart + milliseconds(60));
  flow_.Grant(kStart + milliseconds(130), 4);
  EXPECT_EQ(flow_.window(1), 1000);
  flow_.Grant(kStart + milliseconds(161), 4);
  EXPECT_EQ(flow_.window(1), 100) << "the payload that is not written";
}

TEST_F(FlowControlTest, CreditThatNobodyWaitsForIsKept) {
  flow_.Detach(2);
  flow_.Detach(3);
  flow_.Take(1, 100, kStart);
  flow_.Release(1, 100);
  EXPECT_THAT(flow_.Grant(kStart, 1), ElementsAre(1));
  EXPECT_EQ(flow_.window(1), 1000) << "what it had, and what it took";
  flow_.Grant(kStart + milliseconds(10), 1);
  flow_.Grant(kStart + std::chrono::hours(1), 1);
  EXPECT_EQ(flow_.window(1), 1000);
}

TEST_F(FlowControlTest, AChunkOnItsWayIsAdmittedAfterItsCreditWasTakenBack) {
  flow_.Grant(kStart + milliseconds(130), 4);
  flow_.Grant(kStart + milliseconds(131), 4);
  EXPECT_EQ(flow_.window(1), 0);
  EXPECT_TRUE(flow_.Admits(1, 400));
  flow_.Take(1, 400, kStart + milliseconds(132));
  EXPECT_FALSE(flow_.Admits(1, 601)) << "more than it was ever told";
}

TEST_F(FlowControlTest, ChunksOnTheirWayAreAdmittedAfterASmallerGrant) {
  flow_.Detach(3);
  flow_.Grant(kStart + milliseconds(130), 4);
  flow_.Grant(kStart + milliseconds(131), 4);
  flow_.Take(2, 500, kStart + milliseconds(132));
  flow_.Grant(kStart + milliseconds(260), 4);
  flow_.Grant(kStart + milliseconds(261), 4);
  EXPECT_EQ(flow_.window(1), 500);
  flow_.Take(1, 400, kStart + milliseconds(262));
  EXPECT_TRUE(flow_.Admits(1, 600)) << "the rest of what it was told at first";
}

TEST_F(FlowControlTest, ANewConnectionBeginsWithNothing) {
  flow_.Attach(1);
  EXPECT_EQ(flow_.window(1), 0);
  EXPECT_FALSE(flow_.Admits(1, 1));
  flow_.Grant(kStart + milliseconds(10), 4);
  EXPECT_EQ(flow_.window(2), 1000) << "it was the next in turn";
}

TEST_F(FlowControlTest, WhatAForgottenSessionLeftFillsTheRoomUntilItIsWritten) {
  flow_.Take(1, 700, kStart);
  flow_.Forget(1);
  EXPECT_EQ(flow_.bytes(), 700);
  EXPECT_THAT(flow_.Grant(kStart + milliseconds(1), 4), IsEmpty()) << "300 are too few for a chunk";
  flow_.ReleaseForgotten(700);
  EXPECT_THAT(flow_.Grant(kStart + milliseconds(2), 4), ElementsAre(2));
  EXPECT_EQ(flow_.window(2), 1000) << "and its credit as well";
}

TEST_F(FlowControlTest, ASessionOfSmallChunksIsContentWithLittleRoom) {
  for (int i = 0; i < 20; ++i) {
    flow_.Take(1, 50, kStart);
    flow_.Release(1, 50);
  }
  flow_.Detach(1);
  EXPECT_THAT(flow_.Grant(kStart, 4), ElementsAre(2));
  flow_.Detach(3);
  flow_.Take(2, 900, kStart);
  flow_.Detach(2);
  flow_.Attach(1);
  EXPECT_THAT(flow_.Grant(kStart, 4), ElementsAre(1));
  EXPECT_EQ(flow_.window(1), 100);
}

// Sessions that send, are written, come and go at random, and keep to what they were told.
TEST(FlowControlModelTest, PayloadAndCreditKeepToTheRoomAndNobodyWaitsForEver) {
  constexpr int kSessions = 7;
  base::Random random(5);
  FlowControl flow(kOptions);
  std::map<std::uint32_t, std::int64_t> told, unwritten, taken;
  for (std::uint32_t id = 1; id <= kSessions; ++id) flow.Attach(id);
  FlowControl::Time now = kStart;
  for (int i = 0; i < 20'000; ++i) {
    now += milliseconds(1 + random.UniformInt(9));
    for (const std::uint32_t id : flow.Grant(now, kSessions)) told[id] = flow.window(id);
    std::int64_t windows = 0;
    for (std::uint32_t id = 1; id <= kSessions; ++id) windows += flow.window(id);
    ASSERT_LE(windows, 2 * kOptions.room_bytes);
    ASSERT_LE(flow.bytes(), 2 * kOptions.room_bytes);
    const auto id = static_cast<std::uint32_t>(1 + random.UniformInt(kSessions));
    const auto size = static_cast<std::int64_t>(1 + random.UniformInt(400));
    if (random.UniformInt(50) == 0) {
      flow.Detach(id);
      flow.Attach(id);
      told[id] = 0;
    } else if (unwritten[id] + size <= told[id]) {
      ASSERT_TRUE(flow.Admits(id, size)) << id << " was told " << told[id];
      flow.Take(id, size, now);
      unwritten[id] += size;
      taken[id] += size;
    } else if (unwritten[id] > 0) {
      flow.Release(id, unwritten[id]);
      unwritten[id] = 0;
      told[id] = flow.window(id);  // As an acknowledgement does.
    }
  }
  for (std::uint32_t id = 1; id <= kSessions; ++id) EXPECT_GT(taken[id], 20'000) << id;
}

}  // namespace
}  // namespace slalom::replay
