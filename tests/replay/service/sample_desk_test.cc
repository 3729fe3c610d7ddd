#include "replay/service/sample_desk.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "replay/sample_bytes.h"
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
  for (int turn = 0; turn < 2; ++turn) {
    desk_.Advance(4, 0.0);
    EXPECT_FALSE(network_.Take(peer_));
    EXPECT_EQ(desk_.num_waiting(), 512);
    EXPECT_EQ(desk_.num_held(), 512);
  }
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

// The limiter has as many names as it may, and drops one for each that it does not know.
TEST_F(SampleDeskTest, OneThatIsSilentOrGoneIsTheFirstToBeDropped) {
  for (int i = 0; i < RateLimiter::kMaxLearners; ++i) limiter_.Ask("old-" + std::to_string(i), 0);
  const auto is_dropped_for = [&](const std::string& newcomer) {
    desk_.Advance(4, 0.0);
    EXPECT_EQ(limiter_.granted(), 1000.0);
    limiter_.Ask(newcomer, 0);
    return limiter_.granted() == 0.0;
  };
  Ask(1000);
  EXPECT_FALSE(is_dropped_for("a"));
  desk_.Silent(peer_);
  EXPECT_TRUE(is_dropped_for("b"));
  Ask(1001);
  EXPECT_FALSE(is_dropped_for("c")) << "it is heard of again";
  desk_.Silent(peer_);
  EXPECT_TRUE(is_dropped_for("d"));

  const transport::PeerId second = network_.Connect();
  desk_.Ask(second, "learner", {.cursor = 1000, .batch = 4, .history = 1, .n_step = 1});
  desk_.Advance(4, 0.0);
  desk_.Gone(peer_);
  limiter_.Ask("e", 0);
  EXPECT_EQ(limiter_.granted(), 1000.0) << "it has another connection";
  desk_.Advance(4, 0.0);
  desk_.Gone(second);
  EXPECT_TRUE(is_dropped_for("f"));
}

TEST_F(SampleDeskTest, AllThatAreGoneAreForgottenAtOnce) {
  limiter_.AddSteps(1000);
  RowsSource source(1, 2, 1);
  for (int i = 0; i < 5; ++i) table_.Insert(source.Next(3));
  for (int i = 0; i < 3; ++i) {
    const transport::PeerId peer = network_.Connect();
    desk_.Ask(peer, "learner-" + std::to_string(i),
              {.cursor = 0, .batch = 4, .history = 1, .n_step = 1});
    network_.Cut(peer);
  }
  EXPECT_EQ(desk_.num_waiting(), 3);
  desk_.Advance(4, 0.0);
  EXPECT_EQ(desk_.num_waiting(), 0);
}

/// A desk of a table that is filled later, and a learner.
class SampleDeskTurnsTest : public testing::Test {
 protected:
  void Fill() {
    RowsSource source(3, 2, 1);
    for (int i = 0; i < 5; ++i) table.Insert(source.Next(3));
  }
  void Ask(std::uint64_t cursor) {
    desk.Ask(peer, "learner", {.cursor = cursor, .batch = 4, .history = 1, .n_step = 1});
  }

  Table table{{.capacity = 100}, 3};
  RateLimiter limiter{{.updates_per_step = 0.25, .max_ahead_steps = 5}, 100};
  FakeNetwork network;
  SampleDesk desk{{.seed = 1, .max_sample_bytes = 1 << 20}, &table, &limiter, &network};
  const transport::PeerId peer = network.Connect();
};

TEST_F(SampleDeskTurnsTest, MirrorsAreForAsManyRowsAndLearnersAsThereIsRoomFor) {
  Fill();
  const auto sample = [&](const transport::PeerId& asking, std::uint64_t cursor,
                          std::uint64_t mirror, int places) {
    desk.Ask(asking, "learner",
             {.cursor = cursor,
              .batch = 4,
              .history = 1,
              .n_step = 1,
              .mirror = mirror,
              .mirror_places = places});
    desk.Advance(4, 0.0);
    const auto answer = network.Take(asking);
    return answer ? std::get<proto::SampleReply>(*answer) : proto::SampleReply{};
  };
  EXPECT_EQ(sample(peer, 0, 7, 101).mirror, 0U) << "more than the table's rows";
  EXPECT_EQ(sample(peer, 1, 7, 100).mirror, 7U);
  EXPECT_EQ(sample(peer, 1, 7, 90).mirror, 0U) << "a mirror's places do not change";
  EXPECT_EQ(sample(peer, 2, 8, 100).mirror, 8U);
  const int num_scans = sample(peer, 3, 9, 100).num_scans;
  EXPECT_GT(num_scans, 0);
  EXPECT_EQ(sample(peer, 3, 9, 100).num_scans, 0) << "the same batch again";
  EXPECT_EQ(sample(peer, 3, 10, 100).num_scans, num_scans) << "another mirror is empty";
  EXPECT_EQ(sample(peer, 4, 0, 0).mirror, 0U);
  for (int i = 2; i <= SampleDesk::kMaxMirrors + 1; ++i) {
    const bool has_room = i <= SampleDesk::kMaxMirrors;
    EXPECT_EQ(sample(network.Connect(), 5, 1, 100).mirror, has_room ? 1U : 0U) << i;
  }
  desk.Gone(peer);
  EXPECT_EQ(sample(network.Connect(), 5, 1, 100).mirror, 1U);
}

// Else a learner with many requests keeps the others waiting.
TEST_F(SampleDeskTurnsTest, LearnersAreServedInTurn) {
  Fill();
  const std::vector<transport::PeerId> peers = {network.Connect(), network.Connect(),
                                                network.Connect()};
  for (std::size_t i = 0; i < peers.size(); ++i) {
    for (std::uint64_t cursor = 0; cursor < 4; ++cursor) {
      desk.Ask(peers[i], "learner-" + std::to_string(i),
               {.cursor = cursor, .batch = 4, .history = 1, .n_step = 1});
    }
  }
  for (std::uint64_t round = 0; round < 4; ++round) {
    for (std::size_t i = 0; i < peers.size(); ++i) desk.Advance(1, 0.0);
    for (const transport::PeerId& peer : peers) {
      const auto reply = network.Take(peer);
      ASSERT_TRUE(reply) << "round " << round;
      EXPECT_EQ(std::get<proto::SampleReply>(*reply).cursor, round) << "in the order of asking";
      EXPECT_FALSE(network.Take(peer)) << "round " << round;
    }
  }
  EXPECT_EQ(desk.TakeSampleSeconds().size(), 12u);
  EXPECT_TRUE(desk.TakeSampleSeconds().empty()) << "each is told once";
}

// The network keeps 20 messages for a peer that does not read.
TEST_F(SampleDeskTurnsTest, OneThatReadsLateGetsAllOnceAndInOrder) {
  Fill();
  limiter.AddSteps(4);
  for (std::uint64_t cursor = 0; cursor < 25; ++cursor) Ask(cursor);
  for (int turn = 0; turn < 3; ++turn) desk.Advance(30, 7.0);
  EXPECT_EQ(desk.num_waiting(), 5);
  EXPECT_EQ(limiter.granted(), 20.0);
  for (std::uint64_t cursor = 0; cursor < 25; ++cursor) {
    const auto reply = network.Take(peer);
    ASSERT_TRUE(reply);
    const auto& sample = std::get<proto::SampleReply>(*reply);
    EXPECT_EQ(sample.cursor, cursor);
    EXPECT_EQ(sample.inserted_steps, 104);
    EXPECT_EQ(sample.table_steps, table.num_steps());
    EXPECT_EQ(sample.acting_version, 7.0);
    desk.Advance(30, 7.0);
  }
  EXPECT_EQ(desk.TakeSampleSeconds().size(), 25u) << "one that waits is not drawn again";
  EXPECT_EQ(desk.counts().batches, 25);
  EXPECT_EQ(limiter.granted(), 25.0);
  transport::Frame priorities(PrioritySize(3));
  WritePriorities(std::vector<std::int64_t>{0, 1, 1000}, std::vector<float>{1.0f, 1.0f, 1.0f},
                  priorities.mutable_bytes());
  for (int i = 1; i <= 2; ++i) {
    desk.SetPriorities(peer, {.count = 3}, priorities.bytes());
    EXPECT_EQ(desk.counts().priorities_set, 2 * i);
    EXPECT_EQ(desk.counts().priorities_stale, i);
  }

  // One whose connection is gone is forgotten when it is answered, with a batch or a refusal.
  for (const std::uint64_t cursor : {25, -1}) {
    Ask(25);
    network.Cut(peer);
    if (cursor == 25) {
      desk.Advance(1, 7.0);
    } else {
      Ask(cursor);
    }
    EXPECT_EQ(desk.num_waiting(), 0);
  }
}

// Rows are let in beyond the limit as long as no window is complete, and no longer.
TEST_F(SampleDeskTurnsTest, TheLimiterHoldsAgainOnceThereAreWindows) {
  EXPECT_FALSE(limiter.MayInsert());
  Ask(0);
  desk.Advance(1, 0.0);
  EXPECT_TRUE(limiter.MayInsert());
  Fill();
  desk.Advance(1, 0.0);
  EXPECT_TRUE(network.Take(peer));
  EXPECT_FALSE(limiter.MayInsert());
}

}  // namespace
}  // namespace slalom::replay
