#include "replay/service/sample_desk.h"

#include <gtest/gtest.h>

#include "tests/replay/service/model_actor.h"

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

}  // namespace
}  // namespace slalom::replay
