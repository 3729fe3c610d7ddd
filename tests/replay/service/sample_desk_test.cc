#include "replay/service/sample_desk.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/replay/service/model_actor.h"
#include "tests/replay/service/rows_source.h"

namespace slalom::replay {
namespace {

/// A desk whose limiter holds every sample, and a learner.
class SampleDeskTest : public testing::Test {
 protected:
  void Ask(std::uint64_t cursor) {
    desk_.Ask(peer_, "learner", {.cursor = cursor, .batch = 4, .history = 1, .n_step = 1});
  }

  Table table_{{.capacity = 100}, 1};
  RateLimiter limiter_{{.updates_per_step = 1.0, .learning_starts = 50}, 0};
  FakeNetwork network_;
  SampleDesk desk_{{}, &table_, &limiter_, &network_};
  const transport::PeerId peer_ = network_.Connect();
};

// `learner_service.prefetch` goes to 256 updates, and one that learns a model takes two batches.
TEST_F(SampleDeskTest, TheLargestPrefetchIsHeldWhole) {
  for (std::uint64_t k = 0; k < 512; ++k) Ask(k);
  desk_.Advance(4, 0.0);
  EXPECT_FALSE(network_.Take(peer_));
  EXPECT_EQ(desk_.num_waiting(), 512);
  EXPECT_EQ(desk_.num_held(), 512);
}

TEST_F(SampleDeskTest, RequestsBeyondTheBoundAreRefused) {
  for (std::uint64_t k = 0; k < SampleDesk::kMaxRequests; ++k) Ask(k);
  EXPECT_FALSE(network_.Take(peer_));
  Ask(SampleDesk::kMaxRequests);
  const auto answer = network_.Take(peer_);
  ASSERT_TRUE(answer);
  const auto* const refusal = std::get_if<proto::Refusal>(&*answer);
  ASSERT_NE(refusal, nullptr);
  EXPECT_EQ(refusal->code, proto::RefusalCode::kOverWindow);
  EXPECT_EQ(refusal->about, SampleDesk::kMaxRequests);
  EXPECT_EQ(desk_.num_waiting(), static_cast<std::int64_t>(SampleDesk::kMaxRequests));
}

// Else a learner with many requests keeps the others waiting.
TEST(SampleDeskTurnsTest, LearnersAreServedInTurn) {
  Table table({.capacity = 100}, 3);
  RowsSource source(3, 2, 1);
  for (int i = 0; i < 5; ++i) table.Insert(source.Next(3));
  RateLimiter limiter({.updates_per_step = 1000.0}, table.num_steps());
  FakeNetwork network;
  SampleDesk desk({.seed = 1, .max_sample_bytes = 1 << 20}, &table, &limiter, &network);
  const std::vector<transport::PeerId> peers = {network.Connect(), network.Connect(),
                                                network.Connect()};
  for (std::size_t i = 0; i < peers.size(); ++i) {
    for (std::uint64_t cursor = 0; cursor < 4; ++cursor) {
      desk.Ask(peers[i], "learner-" + std::to_string(i),
               {.cursor = cursor, .batch = 4, .history = 1, .n_step = 1});
    }
  }
  for (int round = 0; round < 4; ++round) {
    for (std::size_t i = 0; i < peers.size(); ++i) desk.Advance(1, 0.0);
    for (const transport::PeerId& peer : peers) {
      EXPECT_TRUE(network.Take(peer)) << "round " << round;
      EXPECT_FALSE(network.Take(peer)) << "round " << round;
    }
  }
  EXPECT_EQ(desk.TakeSampleSeconds().size(), 12u);
  EXPECT_TRUE(desk.TakeSampleSeconds().empty()) << "each is told once";
}

// Rows are let in beyond the limit as long as no window is complete, and no longer.
TEST(SampleDeskTurnsTest, TheLimiterHoldsAgainOnceThereAreWindows) {
  Table table({.capacity = 100}, 3);
  RateLimiter limiter({.updates_per_step = 0.1, .max_ahead_steps = 5}, 100);
  FakeNetwork network;
  SampleDesk desk({.seed = 1, .max_sample_bytes = 1 << 20}, &table, &limiter, &network);
  const transport::PeerId peer = network.Connect();
  EXPECT_FALSE(limiter.MayInsert());
  desk.Ask(peer, "learner", {.cursor = 0, .batch = 4, .history = 1, .n_step = 1});
  desk.Advance(1, 0.0);
  EXPECT_TRUE(limiter.MayInsert());
  RowsSource source(3, 2, 1);
  for (int i = 0; i < 5; ++i) table.Insert(source.Next(3));
  desk.Advance(1, 0.0);
  EXPECT_TRUE(network.Take(peer));
  EXPECT_FALSE(limiter.MayInsert());
}

}  // namespace
}  // namespace slalom::replay
